#include "trajectory_action.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "common/text.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

using Result = action_msgs::FollowJointTrajectoryResult;
using Feedback = action_msgs::FollowJointTrajectoryFeedback;

Result resultOf(int error_code, const std::string& error_string) {
  Result result;
  result.error_code = error_code;
  result.error_string = error_string;
  return result;
}

int errorCodeOf(BadTrajectory::Kind kind) {
  switch (kind) {
    case BadTrajectory::Kind::kJoints:
      return Result::INVALID_JOINTS;
    case BadTrajectory::Kind::kOldStamp:
      return Result::OLD_HEADER_TIMESTAMP;
    case BadTrajectory::Kind::kInvalid:
      break;
  }
  return Result::INVALID_GOAL;
}

// Empty if a motion wasn't planned to last noticeably longer than its points.
std::string slowerText(const FollowingTrajectory& following) {
  constexpr double kNoticeable = 1e-6;
  const double planned = following.move.duration;
  const std::optional<double>& wanted = following.wanted_duration;
  if (!wanted || planned <= *wanted * (1.0 + kNoticeable) + kNoticeable) return {};
  return fmt::format("; it was planned for {} s, but its last point asked for {} s",
                     roundedText(planned), roundedText(*wanted));
}

}  // namespace

TrajectoryAction::TrajectoryAction(const ros::NodeHandle& node, machine::Machine& machine,
                                   CallQueues& queues, ActionTopics& topics, bool allow_slower)
    : MotionAction(onQueue(queues.trajectories(), node), "follow_joint_trajectory", topics,
                   [this] { poll_.begin(); }),
      machine_(machine),
      axes_(axisOfJoint(machine)),
      allow_slower_(allow_slower),
      poll_(onQueue(queues.trajectories(), node), kPollPeriod, [this] { return poll(); }) {
  start();
}

TrajectoryAction::~TrajectoryAction() = default;

// ---- goals and cancels ----

TrajectoryJoint TrajectoryAction::jointOf(const std::string& name) const {
  const axis::Axis& axis = machine_.axis(axes_.at(name));
  const config::AxisConfig& config = axis.config();
  return {name, config.kind, config.steps_per_unit * axis.state().microsteps / config.microsteps};
}

FollowingTrajectory TrajectoryAction::begin(const Server::GoalHandle& handle) {
  const auto goal = handle.getGoal();
  Following following;
  following.handle = handle;
  following.tolerances = readTolerances(*goal);
  following.slipped_before = machine_.figures().slipped;
  following.move = followMessage(machine_, goal->trajectory, axes_, allow_slower_);
  for (const std::string& joint : goal->trajectory.joint_names) {
    following.joints.push_back(jointOf(joint));
  }
  // Any other stamp changes how long the points may take from now on.
  if (goal->trajectory.header.stamp.isZero()) {
    following.wanted_duration = goal->trajectory.points.back().time_from_start.toSec();
  }
  following.goal = goal->trajectory.points.back().positions;
  for (std::size_t i = 0; i < following.goal.size(); ++i) {
    const auto& member = following.move.members[i];
    if (!machine_.axis(member.axis).config().continuous) continue;
    // It goes to the same place, at another turn.
    following.goal[i] +=
        config::kTurn * std::round((member.move.target - following.goal[i]) / config::kTurn);
  }
  following.goal_velocity = goal->trajectory.points.back().velocities;
  following.began = ros::Time::now();
  following.begins_later = goal->trajectory.header.stamp > following.began;
  return following;
}

void TrajectoryAction::reject(GoalHandle& handle, const Error& error) {
  const auto* bad = dynamic_cast<const BadTrajectory*>(&error);
  const int code = bad != nullptr ? errorCodeOf(bad->kind()) : Result::INVALID_GOAL;
  handle.setRejected(resultOf(code, error.what()), error.what());
}

void TrajectoryAction::takeOver(const Following& newer, Following& older) {
  const bool shared =
      std::any_of(older.joints.begin(), older.joints.end(), [&newer](const auto& joint) {
        return std::any_of(newer.joints.begin(), newer.joints.end(),
                           [&joint](const auto& other) { return other.name == joint.name; });
      });
  if (!shared) return;
  (newer.begins_later ? older.followed_by : older.preempted_by) = "a newer goal took over";
}

void TrajectoryAction::stop(const Following& following) { machine_.stop(following.move); }

// ---- current goals ----

void TrajectoryAction::watch(Following& following, bool tell) {
  const Places places = placesOf(following);
  keepToPath(following, places);
  if (tell) publishFeedback(following, places);
}

bool TrajectoryAction::conclude(Following& following) {
  const auto result = machine_.result(following.move);
  if (!result) return false;
  const bool reached = result->end == axis::MoveEnd::kReached;
  GoalHandle& handle = following.handle;
  if (result->end == axis::MoveEnd::kReplaced && following.preempted_by.empty()) {
    following.preempted_by = following.followed_by;
  }
  if (!reached && !following.preempted_by.empty()) {
    const std::string why = fmt::format("{}; {}", following.preempted_by, result->message);
    handle.setCanceled(resultOf(Result::SUCCESSFUL, why), why);
  } else if (!reached && !following.violated.empty()) {
    handle.setAborted(resultOf(Result::PATH_TOLERANCE_VIOLATED, following.violated),
                      following.violated);
  } else if (const std::string why = shortOfGoal(following, *result); !why.empty()) {
    handle.setAborted(resultOf(Result::GOAL_TOLERANCE_VIOLATED, why), why);
  } else {
    const std::string how = result->message + slowerText(following);
    handle.setSucceeded(resultOf(Result::SUCCESSFUL, how), how);
  }
  return true;
}

std::string TrajectoryAction::shortOfGoal(const Following& following,
                                          const machine::CoordinatedResult& result) const {
  // A motion that a stop, a switch or a fault ended stayed on its path, had a valid goal, and isn't
  // SUCCESSFUL: of the available codes, 0 to -5, the missed goal fits best.
  if (result.end != axis::MoveEnd::kReached) return result.message;
  // A motion's duration doesn't include slips.
  const double late = result.duration + machine_.figures().slipped - following.slipped_before -
                      following.move.duration;
  if (late > following.tolerances.goal_time) {
    return fmt::format("it ended {} s later than planned; goal_time_tolerance is {} s",
                       roundedText(late), roundedText(following.tolerances.goal_time));
  }
  std::string why = violation("goal_tolerance", following.joints, following.tolerances.goal,
                              following.goal, result.positions);
  if (!why.empty() || following.goal_velocity.empty()) return why;
  return velocityViolation("goal_tolerance", following.joints, following.tolerances.goal_velocity,
                           following.goal_velocity,
                           std::vector<double>(following.goal_velocity.size()));
}

TrajectoryAction::Places TrajectoryAction::placesOf(const Following& following) const {
  Places places;
  for (const auto& member : following.move.members) {
    const axis::AxisState state = machine_.axis(member.axis).state();
    places.planned.push_back(state.planned);
    places.actual.push_back(state.position);
    places.velocities.push_back(state.velocity);
  }
  return places;
}

void TrajectoryAction::keepToPath(Following& following, const Places& places) {
  if (!following.violated.empty() || !following.preempted_by.empty()) return;
  following.violated = violation("path_tolerance", following.joints, following.tolerances.path,
                                 places.planned, places.actual);
  const auto means = following.velocities.add(ros::SteadyTime::now().toSec(), places);
  if (following.violated.empty() && means) {
    following.violated =
        velocityViolation("path_tolerance", following.joints, following.tolerances.path_velocity,
                          means->planned, means->actual);
  }
  if (!following.violated.empty()) stopMotion(following);
}

void TrajectoryAction::publishFeedback(Following& following, const Places& places) {
  Feedback feedback;
  feedback.header.stamp = ros::Time::now();
  for (const TrajectoryJoint& joint : following.joints) {
    feedback.joint_names.push_back(joint.name);
  }
  const ros::Duration time = feedback.header.stamp - following.began;
  for (auto* point : {&feedback.desired, &feedback.actual, &feedback.error}) {
    point->time_from_start = time;
  }
  feedback.desired.positions = places.planned;
  feedback.actual.positions = places.actual;
  // The only velocity of an axis is that of its plan.
  feedback.desired.velocities = feedback.actual.velocities = places.velocities;
  feedback.error.velocities.resize(places.velocities.size());
  for (std::size_t i = 0; i < places.planned.size(); ++i) {
    feedback.error.positions.push_back(places.planned[i] - places.actual[i]);
  }
  following.handle.publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
