#include "descriptor_watch.h"

#include <dirent.h>
#include <linux/tcp.h>
#include <ros/connection_manager.h>
#include <ros/console.h>
#include <ros/xmlrpc_manager.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <system_error>

#include "common/socket_address.h"

namespace stepdriver::ros_node {
namespace {

// Few are left below this number. A service call takes one, a new topic's client two.
constexpr std::size_t kFew = 16;
// More than this helps nobody, and the kernel's own memory for them isn't free.
constexpr rlim_t kMostWanted = 65536;
// [ms] without a word from a client that has just connected.
constexpr std::uint32_t kFirstWord = 1000;
// [ms] without any data either way.
constexpr std::uint32_t kIdle = 60'000;

rlimit currentLimit() {
  rlimit limit{kMostWanted, kMostWanted};
  getrlimit(RLIMIT_NOFILE, &limit);
  return limit;
}

void raiseLimit() {
  rlimit limit = currentLimit();
  const rlim_t wanted = std::min(limit.rlim_max, kMostWanted);
  if (limit.rlim_cur >= wanted) return;
  limit.rlim_cur = wanted;
  setrlimit(RLIMIT_NOFILE, &limit);
}

struct Connection {
  int descriptor = -1;
  bool spoken = false;       ///< its client has sent something
  std::uint32_t silent = 0;  ///< [ms] since data came or went
};

/// @return no value if the descriptor isn't a connection that roscpp has accepted.
std::optional<Connection> acceptedByRoscpp(int descriptor) {
  const std::uint16_t port = portOf(descriptor);
  if (port == 0) return std::nullopt;
  if (port != ros::ConnectionManager::instance()->getTCPPort() &&
      port != ros::XMLRPCManager::instance()->getServerPort()) {
    return std::nullopt;
  }
  tcp_info info{};
  socklen_t size = sizeof(info);
  if (getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  constexpr std::uint8_t kEstablished = 1;  // the kernel's TCP_ESTABLISHED
  if (info.tcpi_state != kEstablished) return std::nullopt;
  return Connection{descriptor, info.tcpi_bytes_received > 0,
                    std::min(info.tcpi_last_data_recv, info.tcpi_last_data_sent)};
}

}  // namespace

DescriptorWatch::DescriptorWatch() : folder_(opendir("/proc/self/fd")) {
  raiseLimit();
  limit_ = currentLimit().rlim_cur;
  if (folder_ == nullptr) {
    throw std::system_error(errno, std::generic_category(), "/proc/self/fd");
  }
}

DescriptorWatch::~DescriptorWatch() { closedir(folder_); }

void DescriptorWatch::look() {
  const std::vector<int> open = openOnes();
  limit_ = currentLimit().rlim_cur;
  open_ = open.size();
  if (!figures().few_left) return;
  const std::size_t ended = endIdle(open);
  ended_ += ended;
  ROS_WARN_THROTTLE_NAMED(10.0, "node",
                          "%zu of %zu file descriptors are in use: %zu idle connections are ended",
                          open.size(), limit_.load(), ended);
}

DescriptorWatch::Figures DescriptorWatch::figures() const {
  const std::size_t open = open_;
  return {open, limit_, ended_, open + kFew > limit_};
}

std::vector<int> DescriptorWatch::openOnes() {
  std::vector<int> open;
  rewinddir(folder_);
  while (const dirent* entry = readdir(folder_)) {
    if (entry->d_name[0] != '.') open.push_back(std::atoi(entry->d_name));
  }
  return open;
}

// roscpp sees that a connection has ended, and closes it itself.
std::size_t DescriptorWatch::endIdle(const std::vector<int>& open) const {
  std::vector<Connection> idle;
  for (const int descriptor : open) {
    const auto connection = acceptedByRoscpp(descriptor);
    if (!connection) continue;
    if (connection->silent >= (connection->spoken ? kIdle : kFirstWord))
      idle.push_back(*connection);
  }
  // Those who have never spoken all go. Of the others only as many as it takes, the longest silent
  // first: they may be clients that wait for their next call.
  std::sort(idle.begin(), idle.end(), [](const Connection& one, const Connection& other) {
    return one.spoken != other.spoken ? other.spoken : one.silent > other.silent;
  });
  const std::size_t too_many = open.size() + kFew - limit_;
  std::size_t ended = 0;
  for (const Connection& connection : idle) {
    if (connection.spoken && ended >= too_many) break;
    if (shutdown(connection.descriptor, SHUT_RDWR) == 0) ++ended;
  }
  return ended;
}

}  // namespace stepdriver::ros_node
