#pragma once

#include <ros/node_handle.h>
#include <stepdriver/MoveLineAction.h>

#include <algorithm>
#include <cstddef>

#include "coordinated_action.h"
#include "node/line_request.h"

namespace stepdriver::ros_node {

/// The action ~move_line: the service as an action.
class LineAction : public CoordinatedAction<MoveLineAction> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, statuses outlive the action.
  LineAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
             ActionStatuses& statuses)
      : CoordinatedAction(node, "move_line", machine, queues, statuses) {
    start();
  }

 private:
  machine::CoordinatedMove move(const MoveLineGoal& goal) override {
    return machine().moveLine(lineRequest(goal));
  }

  double progressOfGoal(const Following& following, const States& states) const override {
    double progress = 1.0;
    for (std::size_t i = 0; i < states.size(); ++i) {
      progress = std::min(progress, progressOf(following.began_at[i], states[i].position,
                                               following.move.members[i].move.target));
    }
    return progress;
  }
};

}  // namespace stepdriver::ros_node
