#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "profile/profile.h"
#include "support/steps_of.h"
#include "trajectory/path_axis.h"
#include "trajectory/path_plan.h"
#include "trajectory/prepared_trajectory.h"
#include "trajectory/queued_path.h"
#include "trajectory/spline.h"
#include "trajectory/trajectory_path.h"

// Paths from the request to the steps that come out, without a machine.

namespace stepdriver::test {

/// A speed that is measured between two steps, a microstep apart, may be this much too high: each
/// of them may come too soon or too late by the part of a microstep by which cubics deviate from a
/// quintic. What a plan exceeds a speed by, it is slowed down by as a whole, except from a speed: a
/// thousandth is left then. The speed that is allowed is the highest one of all that is within the
/// tolerance, so a rounded corner adds nothing.
inline constexpr double kMostOverSpeed = 1.0 + 2.0 * motion::kQuinticError + 0.001;

/// An axis at rest at 0, without a start speed, a backlash or soft limits.
struct PathAxisLimits {
  double steps_per_unit = 80'000.0;  ///< [microsteps/unit]
  double speed = 0.1;                ///< [unit/s]
  double acceleration = 1.0;         ///< [unit/s^2]
  double jerk = 0.0;                 ///< [unit/s^3] 0: no limit
};

inline motion::PathAxis pathAxis(const std::string& name, const PathAxisLimits& given) {
  motion::PathAxis axis;
  axis.name = name;
  axis.microsteps = 16;
  axis.steps_per_unit = given.steps_per_unit;
  axis.limits.max_speed = given.speed * given.steps_per_unit;
  axis.limits.acceleration = axis.limits.deceleration = given.acceleration * given.steps_per_unit;
  axis.limits.jerk = given.jerk * given.steps_per_unit;
  axis.stop_limits = axis.limits;
  return axis;
}

/// The steps of one axis.
using AxisSteps = std::vector<std::pair<std::int64_t, int>>;

struct PlannedPath {
  motion::PathPlan plan;
  std::shared_ptr<const motion::SharedPath> path;
  std::vector<std::shared_ptr<const motion::Profile>> curves;  ///< one for each axis

  AxisSteps steps(std::size_t axis) const { return motion::stepsOf(*curves[axis]); }
  std::int64_t endCount(std::size_t axis) const {
    std::int64_t count = 0;
    for (const auto& step : steps(axis)) count += step.second;
    return count;
  }
  double duration() const { return curves.front()->duration().value(); }
};

/// The path as the machine plans it, from rest.
/// @param places [microsteps] where the first axes rest; the others rest at 0.
inline PlannedPath planned(const motion::PathRequest& request,
                           const std::vector<motion::PathAxis>& axes,
                           const std::vector<double>& places = {}) {
  PlannedPath made;
  std::vector<motion::PathOrigin> origins(axes.size());
  std::vector<motion::MotionState> rest(axes.size());
  std::vector<motion::PathStart> starts(axes.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    origins[i] = {places[i], places[i] / axes[i].steps_per_unit};
    rest[i].position = starts[i].motor.position = places[i];
  }
  made.plan = motion::planPath(request, axes, origins);
  const auto prepared =
      std::make_shared<const motion::PreparedTrajectory>(axes, made.plan.points, rest);
  made.path = motion::PreparedTrajectory::join(prepared, starts);
  const auto& trajectory = dynamic_cast<const motion::TrajectoryPath&>(*made.path);
  for (const auto& member : trajectory.members()) made.curves.push_back(member.curve);
  return made;
}

/// The same if segments are appended, and the motion may change from a time [s] on.
inline PlannedPath fed(const PlannedPath& path, const std::vector<motion::PathSegment>& segments,
                       double changeable) {
  const motion::QueuedPath queued(path.path, path.plan.window, true);
  const motion::QueuedPath::Longer longer = queued.extended(segments, false, 0.0, changeable);
  PlannedPath made;
  made.path = longer.path;
  const motion::Profile along = made.path->plan(0, made.path->begin(), 1.0);
  for (std::size_t i = 0; i < path.curves.size(); ++i) {
    made.curves.push_back(std::make_shared<const motion::Profile>(made.path->profileOf(i, along)));
  }
  return made;
}

}  // namespace stepdriver::test
