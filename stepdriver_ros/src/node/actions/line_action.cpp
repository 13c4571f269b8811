#include "line_action.h"

#include <algorithm>
#include <cstddef>

#include "move_end.h"
#include "node/line_request.h"

namespace stepdriver::ros_node {

LineAction::LineAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
                       ActionTopics& topics)
    : CoordinatedAction(node, "move_line", machine, queues, topics) {
  start();
}

LineAction::~LineAction() = default;

machine::CoordinatedMove LineAction::move(const MoveLineGoal& goal) {
  return machine().moveLine(lineRequest(goal));
}

double LineAction::progressOfGoal(const Following& following, const States& states) const {
  double progress = 1.0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    progress = std::min(progress, progressOf(following.began_at[i], states[i].position,
                                             following.move.members[i].move.target));
  }
  return progress;
}

}  // namespace stepdriver::ros_node
