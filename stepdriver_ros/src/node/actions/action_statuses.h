#pragma once

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <functional>
#include <mutex>
#include <vector>

namespace stepdriver::ros_node {

/// Publishes the statuses of all actions together: with a timer for each action, as in actionlib's
/// servers, a node with many axes would never sleep.
class ActionStatuses {
 public:
  /// @param node a handle with the queue that publishes them.
  /// @param frequency [Hz]; 0: never.
  ActionStatuses(const ros::NodeHandle& node, double frequency);
  ActionStatuses(const ActionStatuses&) = delete;
  ActionStatuses& operator=(const ActionStatuses&) = delete;

  /// @param publish publishes an action's status; called as long as the queue is served.
  void add(std::function<void()> publish);

 private:
  void publish();

  std::mutex mutex_;
  std::vector<std::function<void()>> actions_;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
