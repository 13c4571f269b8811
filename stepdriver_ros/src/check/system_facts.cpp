#include <grp.h>
#include <pwd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "system_report.h"

namespace stepdriver::check {
namespace {

constexpr unsigned kPermissionBits = 07777;

std::string userName(uid_t user) {
  const passwd* entry = getpwuid(user);
  return entry != nullptr ? entry->pw_name : std::to_string(user);
}

std::string groupName(gid_t group) {
  const struct group* entry = getgrgid(group);
  return entry != nullptr ? entry->gr_name : std::to_string(group);
}

std::vector<std::string> groupNames() {
  std::vector<gid_t> ids(static_cast<std::size_t>(std::max(getgroups(0, nullptr), 0)));
  const int count = getgroups(static_cast<int>(ids.size()), ids.data());
  ids.resize(static_cast<std::size_t>(std::max(count, 0)));
  if (std::find(ids.begin(), ids.end(), getegid()) == ids.end()) ids.insert(ids.begin(), getegid());
  std::vector<std::string> names;
  names.reserve(ids.size());
  for (const gid_t id : ids) names.push_back(groupName(id));
  return names;
}

std::vector<DeviceNode> chipNodes() {
  std::vector<DeviceNode> nodes;
  std::error_code error;
  for (std::filesystem::directory_iterator file("/dev", error), end; !error && file != end;
       file.increment(error)) {
    const std::string path = file->path().string();
    struct stat status {};
    if (path.rfind("/dev/gpiochip", 0) != 0 || stat(path.c_str(), &status) != 0) continue;
    nodes.push_back({path, userName(status.st_uid), groupName(status.st_gid),
                     status.st_mode & kPermissionBits, eaccess(path.c_str(), R_OK | W_OK) == 0});
  }
  std::sort(nodes.begin(), nodes.end(),
            [](const DeviceNode& a, const DeviceNode& b) { return a.path < b.path; });
  return nodes;
}

std::string limitOf(int resource) {
  rlimit limit{};
  if (getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0) return "";
  return limit.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(limit.rlim_cur);
}

std::string firstLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

}  // namespace

SystemFacts systemFacts() {
  SystemFacts facts;
  facts.user = userName(geteuid());
  facts.groups = groupNames();
  facts.chips = chipNodes();
  facts.udev_rule = std::filesystem::exists("/etc/udev/rules.d/60-stepdriver-gpio.rules");
  facts.rtprio = limitOf(RLIMIT_RTPRIO);
  facts.memlock = limitOf(RLIMIT_MEMLOCK);
  facts.rt_runtime_us = firstLine("/proc/sys/kernel/sched_rt_runtime_us");
  facts.rt_period_us = firstLine("/proc/sys/kernel/sched_rt_period_us");
  utsname name{};
  if (uname(&name) == 0) facts.kernel = std::string(name.release) + " " + name.version;
  // The place depends on the version of the kernel.
  facts.preempt_rt = firstLine("/sys/kernel/realtime") == "1" ||
                     facts.kernel.find("PREEMPT_RT") != std::string::npos ||
                     facts.kernel.find("PREEMPT RT") != std::string::npos;
  facts.cpu_dma_latency = eaccess("/dev/cpu_dma_latency", W_OK) == 0;
  return facts;
}

}  // namespace stepdriver::check
