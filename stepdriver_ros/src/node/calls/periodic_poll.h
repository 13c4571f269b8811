#pragma once

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <functional>
#include <mutex>

namespace stepdriver::ros_node {

/// Calls a function each period while there is something to poll; otherwise nothing wakes up.
class PeriodicPoll {
 public:
  /// @param node a handle with the queue that calls the function.
  /// @param poll returns whether it must be called again.
  PeriodicPoll(const ros::NodeHandle& node, ros::WallDuration period, std::function<bool()> poll);
  PeriodicPoll(const PeriodicPoll&) = delete;
  PeriodicPoll& operator=(const PeriodicPoll&) = delete;

  /// There is something to poll: the first call comes after a period. Safe from any thread, and
  /// from the function itself.
  void begin();

 private:
  void call();

  const std::function<bool()> poll_;
  std::mutex mutex_;
  bool begun_ = false;  // since the last call began
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
