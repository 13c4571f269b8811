#include "path_action.h"

#include <algorithm>
#include <cstdint>

#include "node/path_request.h"

namespace stepdriver::ros_node {

PathAction::PathAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
                       ActionTopics& topics)
    : CoordinatedAction(node, "follow_path", machine, queues, topics) {
  start();
}

PathAction::~PathAction() = default;

machine::CoordinatedMove PathAction::move(const FollowPathGoal& goal) {
  return machine().followPath(pathRequest(goal));
}

double PathAction::progressOfGoal(const Following& following, const States& states) const {
  double time_left = 0.0;
  for (const axis::AxisState& state : states) {
    // Then the time left is that until it is at rest.
    if (state.held) return following.progress;
    time_left = std::max(time_left, state.time_left);
  }
  if (const auto ahead = machine().pathAhead(following.move.id())) {
    const double all = ahead->passed + ahead->time;
    return std::clamp(all > 0.0 ? ahead->passed / all : 0.0, following.progress, 1.0);
  }
  const double duration = following.move.duration;
  const double covered = duration > 0.0 ? 1.0 - time_left / duration : 1.0;
  return std::clamp(covered, following.progress, 1.0);
}

void PathAction::complete(const Following& following, FollowPathFeedback& feedback) const {
  feedback.path = following.move.id();
  if (const auto ahead = machine().pathAhead(feedback.path)) {
    feedback.segments_ahead = static_cast<std::uint32_t>(ahead->segments);
  }
}

void PathAction::completeResult(const machine::CoordinatedResult& ended,
                                FollowPathResult& result) const {
  result.switched = static_cast<std::uint32_t>(ended.marks_made);
  result.not_switched = static_cast<std::uint32_t>(ended.marks_not_made);
  if (!ended.marks_known) result.message += "; how often it switched outputs isn't known";
}

}  // namespace stepdriver::ros_node
