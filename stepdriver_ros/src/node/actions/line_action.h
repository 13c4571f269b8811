#pragma once

#include <ros/node_handle.h>
#include <stepdriver/MoveLineAction.h>

#include "coordinated_action.h"

namespace stepdriver::ros_node {

/// The action ~move_line: the service as an action.
class LineAction : public CoordinatedAction<MoveLineAction> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, topics outlive the action.
  LineAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
             ActionTopics& topics);
  ~LineAction() override;

 private:
  machine::CoordinatedMove move(const MoveLineGoal& goal) override;
  double progressOfGoal(const Following& following, const States& states) const override;
};

}  // namespace stepdriver::ros_node
