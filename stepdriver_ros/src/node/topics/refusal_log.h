#pragma once

#include <ros/time.h>

#include <map>
#include <mutex>
#include <string>

namespace stepdriver::ros_node {

/// Warns of what a topic's messages were refused for, as a topic has no answer: each reason at most
/// once a second, whatever numbers are in it. Safe from any thread.
class RefusalLog {
 public:
  /// @param source what the message came by; it stands before the reason.
  explicit RefusalLog(std::string source) : source_(std::move(source)) {}

  void warn(const std::string& reason);

 private:
  const std::string source_;
  std::mutex mutex_;
  std::map<std::string, ros::SteadyTime> said_;  // of the last second
};

}  // namespace stepdriver::ros_node
