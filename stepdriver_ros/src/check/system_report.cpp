#include "system_report.h"

#include <fmt/format.h>

#include <cerrno>

#include "gpio/chip_table.h"
#include "table.h"

namespace stepdriver::check {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::string modeText(unsigned mode) { return fmt::format("{:04o}", mode); }

bool isNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

std::string orUnknown(const std::string& text) { return text.empty() ? "unknown" : text; }

/// In the kernel's format: microseconds of each period, or -1 for the whole period.
std::string throttleText(const SystemFacts& facts) {
  if (facts.rt_runtime_us.empty()) return "unknown";
  if (facts.rt_runtime_us == "-1") return "none (sched_rt_runtime_us -1)";
  return fmt::format("real-time threads run for {} of each {} us (sched_rt_runtime_us)",
                     facts.rt_runtime_us, facts.rt_period_us);
}

}  // namespace

std::string permissionsText(const SystemFacts& facts) {
  std::string text = table({{"user", facts.user}, {"groups", joined(facts.groups)}});
  bool all_usable = true;
  std::vector<std::vector<std::string>> rows;
  for (const DeviceNode& node : facts.chips) {
    rows.push_back({node.path, node.owner + ":" + node.group, modeText(node.mode),
                    node.usable ? "may be used" : "may not be used"});
    all_usable = all_usable && node.usable;
  }
  text += rows.empty() ? "  no /dev/gpiochip*\n" : table(rows);
  text +=
      fmt::format("  config/udev/60-stepdriver-gpio.rules is {}installed in /etc/udev/rules.d{}\n",
                  facts.udev_rule ? "" : "not ",
                  all_usable && !rows.empty() && !facts.udev_rule ? ", and not needed" : "");
  if (!all_usable) text += " " + gpio::remedyFor(EACCES) + "\n";
  return text;
}

std::string limitsText(const SystemFacts& facts, const pulse::RealtimeRights& rights) {
  return table(
      {{"rights", rights.text()},
       {"RLIMIT_RTPRIO", orUnknown(facts.rtprio)},
       {"RLIMIT_MEMLOCK", orUnknown(facts.memlock) + (isNumber(facts.memlock) ? " bytes" : "")},
       {"throttle", throttleText(facts)},
       {"kernel", facts.kernel},
       {"PREEMPT_RT", facts.preempt_rt ? "yes" : "no"},
       {"/dev/cpu_dma_latency", facts.cpu_dma_latency ? "may be written" : "may not be written"}});
}

}  // namespace stepdriver::check
