#pragma once

#include <ros/node_handle.h>
#include <stepdriver/FollowPathAction.h>

#include "coordinated_action.h"

namespace stepdriver::ros_node {

/// The action ~follow_path: the service as an action.
class PathAction : public CoordinatedAction<FollowPathAction> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, topics outlive the action.
  PathAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
             ActionTopics& topics);
  ~PathAction() override;

 private:
  machine::CoordinatedMove move(const FollowPathGoal& goal) override;
  /// The progress follows the planned time, because a path may pass the same place several times.
  double progressOfGoal(const Following& following, const States& states) const override;
  void complete(const Following& following, FollowPathFeedback& feedback) const override;
  void completeResult(const machine::CoordinatedResult& ended,
                      FollowPathResult& result) const override;
};

}  // namespace stepdriver::ros_node
