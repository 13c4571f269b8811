#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::check {

/// A file in /dev, and whether this process may read and write it.
struct DeviceNode {
  std::string path;
  std::string owner;
  std::string group;
  unsigned mode = 0;  ///< the permission bits
  bool usable = false;
};

/// What the system allows this process. A text is empty if the system doesn't provide it.
struct SystemFacts {
  std::string user;
  std::vector<std::string> groups;
  std::vector<DeviceNode> chips;
  bool udev_rule = false;     ///< /etc/udev/rules.d has stepdriver's
  std::string rtprio;         ///< RLIMIT_RTPRIO
  std::string memlock;        ///< RLIMIT_MEMLOCK
  std::string rt_runtime_us;  ///< how long real-time threads may run in each rt_period_us
  std::string rt_period_us;
  std::string kernel;  ///< release and version
  bool preempt_rt = false;
  bool cpu_dma_latency = false;  ///< /dev/cpu_dma_latency may be written
};

SystemFacts systemFacts();

/// The users that may use the GPIO chips.
std::string permissionsText(const SystemFacts& facts);

/// @param rights as granted on request.
std::string limitsText(const SystemFacts& facts, const pulse::RealtimeRights& rights);

}  // namespace stepdriver::check
