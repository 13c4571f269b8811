#pragma once

#include <ros/time.h>

#include <map>
#include <mutex>
#include <string>

namespace stepdriver::ros_node {

/// Decides which refusals are logged: each reason at most once a second, regardless of the numbers
/// in it. Safe from any thread.
class RefusalLog {
 public:
  /// Whether to log it now.
  bool isDue(const std::string& reason);

 private:
  std::mutex mutex_;
  std::map<std::string, ros::SteadyTime> said_;  // the reasons of the last second
};

/// Logs why a service call or a goal was refused.
void logRefusal(const std::string& reason);

}  // namespace stepdriver::ros_node
