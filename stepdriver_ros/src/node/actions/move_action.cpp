#include "move_action.h"

#include <utility>

#include "move_end.h"

namespace stepdriver::ros_node {

AxisMoveAction::AxisMoveAction(const ros::NodeHandle& node, axis::Axis& axis, ActionTopics& topics,
                               std::function<void()> begun)
    : MotionAction(node, "move", topics, std::move(begun)), axis_(axis) {
  start();
}

AxisMoveAction::~AxisMoveAction() = default;

FollowingMove AxisMoveAction::begin(const GoalHandle& handle) {
  const auto goal = handle.getGoal();
  FollowingMove following;
  following.handle = handle;
  following.began_at = axis_.state().position;
  following.move =
      axis_.moveTo(goal->position, goal->relative != 0, goal->velocity, goal->shortest != 0);
  return following;
}

void AxisMoveAction::reject(GoalHandle& handle, const Error& error) {
  MoveResult result;
  result.end = MoveResult::REFUSED;
  result.message = error.what();
  result.position = axis_.state().position;
  handle.setRejected(result, result.message);
}

void AxisMoveAction::stop(const FollowingMove& following) { axis_.stop(following.move); }

bool AxisMoveAction::conclude(FollowingMove& following) {
  const auto ended = axis_.result(following.move);
  if (!ended) return false;
  MoveResult result;
  result.end = endOf(ended->end);
  result.message = ended->message;
  result.position = ended->position;
  result.duration = ended->duration;
  reportEnd(following.handle, result, following.preempted_by);
  return true;
}

void AxisMoveAction::watch(FollowingMove& following, bool tell) {
  if (!tell) return;
  const axis::AxisState state = axis_.state();
  MoveFeedback feedback;
  feedback.position = state.position;
  feedback.velocity = state.velocity;
  feedback.progress = progressOf(following.began_at, state.position, following.move.target);
  feedback.time_left = state.time_left;
  following.handle.publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
