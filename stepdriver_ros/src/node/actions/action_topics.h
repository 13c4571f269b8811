#pragma once

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <functional>
#include <mutex>
#include <vector>

#include "common/latched_messages.h"

namespace stepdriver::ros_node {

/// What the topics of all actions share. Their statuses are published together: with a timer for
/// each action, as in actionlib's servers, a node with many axes would never sleep.
class ActionTopics {
 public:
  /// @param node a handle with the queue that publishes the statuses.
  /// @param status_frequency [Hz]; 0: never.
  /// @param latched outlives the actions.
  ActionTopics(const ros::NodeHandle& node, double status_frequency, LatchedMessages& latched);
  ActionTopics(const ActionTopics&) = delete;
  ActionTopics& operator=(const ActionTopics&) = delete;

  /// @param publish publishes an action's status; called as long as the queue is served.
  void addStatus(std::function<void()> publish);

  /// Recognizes goals that were latched before the node could receive them.
  LatchedMessages& latched() { return latched_; }

 private:
  void publish();

  LatchedMessages& latched_;
  std::mutex mutex_;
  std::vector<std::function<void()>> statuses_;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
