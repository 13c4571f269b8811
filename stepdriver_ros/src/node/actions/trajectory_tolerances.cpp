#include "trajectory_tolerances.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "node/topics/trajectory_message.h"

namespace stepdriver::ros_node {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();
constexpr double kPartsOfAMicrostep = 100.0;

[[noreturn]] void refuse(const std::string& why) {
  throw BadTrajectory(BadTrajectory::Kind::kInvalid, why);
}

// 0 means the default, which is no limit; a negative number removes the limit too.
double limitOf(double tolerance) { return tolerance > 0.0 ? tolerance : kNoLimit; }

template <typename Tolerances, typename Number>
std::vector<double> limitsOf(const std::vector<std::string>& joints, const Tolerances& tolerances,
                             const std::string& name, const char* what, Number number) {
  std::vector<double> limits(joints.size(), kNoLimit);
  for (const auto& tolerance : tolerances) {
    const auto joint = std::find(joints.begin(), joints.end(), tolerance.name);
    if (joint == joints.end()) {
      refuse(fmt::format("{} names the joint {}, but the trajectory has {}", name, tolerance.name,
                         fmt::join(joints, ", ")));
    }
    if (std::isnan(tolerance.*number)) {
      refuse(fmt::format("{}{} of the joint {} is nan, but must be a number", name, what,
                         tolerance.name));
    }
    limits[static_cast<std::size_t>(joint - joints.begin())] = limitOf(tolerance.*number);
  }
  return limits;
}

}  // namespace

TrajectoryTolerances readTolerances(const action_msgs::FollowJointTrajectoryGoal& goal) {
  const std::vector<std::string>& joints = goal.trajectory.joint_names;
  const auto of_position = &action_msgs::JointTolerance::position;
  const auto of_velocity = &action_msgs::JointTolerance::velocity;
  TrajectoryTolerances limits;
  limits.path = limitsOf(joints, goal.path_tolerance, "path_tolerance", "", of_position);
  limits.goal = limitsOf(joints, goal.goal_tolerance, "goal_tolerance", "", of_position);
  limits.path_velocity =
      limitsOf(joints, goal.path_tolerance, "path_tolerance", "'s velocity", of_velocity);
  limits.goal_velocity =
      limitsOf(joints, goal.goal_tolerance, "goal_tolerance", "'s velocity", of_velocity);
  limits.goal_time = limitOf(goal.goal_time_tolerance.toSec());
  return limits;
}

std::optional<JointPlaces> MeanVelocities::add(double now, const JointPlaces& places) {
  constexpr double kWindow = 0.1;  // s
  past_.emplace_back(now, places);
  while (past_.size() > 1 && now - past_[1].first >= kWindow) past_.pop_front();
  const auto& [before, then] = past_.front();
  if (now - before < kWindow) return std::nullopt;
  JointPlaces velocities;
  for (std::size_t i = 0; i < places.planned.size(); ++i) {
    velocities.planned.push_back((places.planned[i] - then.planned[i]) / (now - before));
    velocities.actual.push_back((places.actual[i] - then.actual[i]) / (now - before));
  }
  return velocities;
}

std::string velocityViolation(const char* tolerance, const std::vector<TrajectoryJoint>& joints,
                              const std::vector<double>& limits, const std::vector<double>& wanted,
                              const std::vector<double>& actual) {
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const double off = std::abs(wanted[i] - actual[i]);
    if (off <= limits[i]) continue;
    return fmt::format("{} moves at {:.6g} {}/s, {:.6g} {}/s from {:.6g} {}/s; {} is {:.9g} {}/s",
                       joints[i].name, actual[i], config::unitOf(joints[i].kind), off,
                       config::unitOf(joints[i].kind), wanted[i], config::unitOf(joints[i].kind),
                       tolerance, limits[i], config::unitOf(joints[i].kind));
  }
  return {};
}

std::string violation(const char* tolerance, const std::vector<TrajectoryJoint>& joints,
                      const std::vector<double>& limits, const std::vector<double>& wanted,
                      const std::vector<double>& actual) {
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const double off = std::abs(wanted[i] - actual[i]);
    if (off <= limits[i]) continue;
    const auto& [name, kind, scale] = joints[i];
    // A goal need not be on a whole microstep.
    return fmt::format("{} is at {}, {} from {}; {} is {:.9g} {}", name,
                       config::placeText(actual[i], kind, scale),
                       config::distanceText(off, kind, scale),
                       config::placeText(wanted[i], kind, scale * kPartsOfAMicrostep), tolerance,
                       limits[i], config::unitOf(kind));
  }
  return {};
}

}  // namespace stepdriver::ros_node
