#pragma once

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <functional>
#include <mutex>
#include <vector>

namespace stepdriver::ros_node {

/// Publishes the statuses of all actions at one beat: with a timer for each of them, as actionlib's
/// servers have it, a node with many axes would never sleep.
class ActionStatuses {
 public:
  /// @param node a handle with the queue that they are published by; above the actions' names
  ///   `actionlib_status_frequency` says how often, 5 Hz where it is missing.
  explicit ActionStatuses(const ros::NodeHandle& node);
  ActionStatuses(const ActionStatuses&) = delete;
  ActionStatuses& operator=(const ActionStatuses&) = delete;

  /// @param publish an action's status; is called for as long as the queue is served.
  void add(std::function<void()> publish);

 private:
  void publish();

  std::mutex mutex_;
  std::vector<std::function<void()>> actions_;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
