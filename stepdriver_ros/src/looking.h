#pragma once

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <functional>
#include <mutex>

namespace stepdriver::ros_node {

/// Looks at something each period, for as long as there is anything to look at; else nothing wakes.
class Looking {
 public:
  /// @param node a handle with the queue that the looks are called by.
  /// @param look returns whether there is still anything to look at.
  Looking(const ros::NodeHandle& node, ros::WallDuration period, std::function<bool()> look);
  Looking(const Looking&) = delete;
  Looking& operator=(const Looking&) = delete;

  /// There is something to look at, from a period on. Safe from any thread, and in a look too.
  void begin();

 private:
  void call();

  const std::function<bool()> look_;
  std::mutex mutex_;
  bool begun_ = false;  // since the last look began
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
