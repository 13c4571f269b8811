#pragma once

#include <ros/time.h>

#include <map>
#include <mutex>
#include <string>

namespace stepdriver::ros_node {

/// Logs why a topic's messages were refused, because a topic has no answer: each reason at most
/// once a second, regardless of the numbers in it. Safe from any thread.
class RefusalLog {
 public:
  /// @param source of the messages; logged before the reason.
  explicit RefusalLog(std::string source) : source_(std::move(source)) {}

  void warn(const std::string& reason);

 private:
  const std::string source_;
  std::mutex mutex_;
  std::map<std::string, ros::SteadyTime> said_;  // of the last second
};

}  // namespace stepdriver::ros_node
