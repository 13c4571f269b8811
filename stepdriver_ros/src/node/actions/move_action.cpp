#include "move_action.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace stepdriver::ros_node {
namespace {

int endOf(axis::MoveEnd end) {
  switch (end) {
    case axis::MoveEnd::kReached:
      return MoveResult::REACHED;
    case axis::MoveEnd::kStopped:
      return MoveResult::STOPPED;
    case axis::MoveEnd::kReplaced:
      return MoveResult::REPLACED;
    case axis::MoveEnd::kEndstopMin:
      return MoveResult::ENDSTOP_MIN;
    case axis::MoveEnd::kEndstopMax:
      return MoveResult::ENDSTOP_MAX;
    case axis::MoveEnd::kEmergencyStop:
      return MoveResult::EMERGENCY_STOP;
    case axis::MoveEnd::kFault:
    case axis::MoveEnd::kCompanion:  // the motion of one axis has no companions
      break;
  }
  return MoveResult::FAULT;
}

double progressOf(double from, double position, double target) {
  const double way = std::abs(target - from);
  return way > 0.0 ? std::clamp(1.0 - std::abs(target - position) / way, 0.0, 1.0) : 1.0;
}

}  // namespace

AxisMoveAction::AxisMoveAction(const ros::NodeHandle& node, axis::Axis& axis,
                               ActionStatuses& statuses, std::function<void()> begun)
    : MotionAction(node, "move", statuses, std::move(begun)), axis_(axis) {
  start();
}

FollowingMove AxisMoveAction::begin(const GoalHandle& handle) {
  const auto goal = handle.getGoal();
  FollowingMove following;
  following.handle = handle;
  following.began_at = axis_.state().position;
  following.move = axis_.moveTo(goal->position, goal->relative != 0, goal->velocity);
  return following;
}

void AxisMoveAction::reject(GoalHandle& handle, const Error& error) {
  MoveResult result;
  result.end = MoveResult::REFUSED;
  result.message = error.what();
  result.position = axis_.state().position;
  handle.setRejected(result, result.message);
}

void AxisMoveAction::stop(const FollowingMove& following) {
  try {
    axis_.stop(following.move);
  } catch (const Error& error) {
    ROS_ERROR_NAMED("move", "%s/move: %s", axis_.config().name.c_str(), error.what());
  }
}

bool AxisMoveAction::conclude(FollowingMove& following) {
  const auto ended = axis_.result(following.move);
  if (!ended) return false;
  MoveResult result;
  result.end = endOf(ended->end);
  result.message = ended->message;
  result.position = ended->position;
  result.duration = ended->duration;
  if (ended->end == axis::MoveEnd::kReached) {
    following.handle.setSucceeded(result, result.message);
  } else if (ended->end == axis::MoveEnd::kReplaced || !following.preempted_by.empty()) {
    following.handle.setCanceled(result, result.message);
  } else {
    following.handle.setAborted(result, result.message);
  }
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
