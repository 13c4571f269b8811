#include "trajectory_course.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "message_text.h"
#include "stepdriver_core/motion/along.h"
#include "stepdriver_core/motion/backlash.h"
#include "stepdriver_core/motion/profile_parts.h"
#include "stepdriver_core/motion/profile_peaks.h"
#include "stepdriver_core/motion/rate.h"

namespace stepdriver::axis {
namespace {

using motion::DoubleDouble;

constexpr double kSteepest = 1000.0;  // 1/s: from full rate to none in a millisecond
constexpr double kSteepestJerk = kSteepest * kSteepest;  // 1/s^2
constexpr double kGentler = 0.8;
constexpr int kTries = 60;             // down to a millionth of the steepest
constexpr double kFirstDelay = 0.010;  // s

std::string at(double seconds) { return roughText(seconds) + " s after its start"; }

double mostAcceleration(const motion::MotionLimits& limits) {
  return std::max(limits.acceleration, limits.deceleration);
}

// When a path that planRate() has made comes to the rate, or to its end [s].
double timeToRate(const motion::Profile& path, double rate) {
  const double duration = path.duration().value();
  if (path.pieces().empty()) return duration;
  const motion::Piece& last = path.pieces().back();
  const bool there = rate > 0.0 && last.v0 == rate && last.a == 0.0 && last.j == 0.0;
  return there ? duration - last.duration.value() : duration;
}

}  // namespace

TrajectoryCourse::TrajectoryCourse(std::vector<Axis::Impl*> own_axes,
                                   const std::vector<CoursePoint>& points)
    : Course(std::move(own_axes)), waypoints_(axes().size()) {
  if (points.empty()) axes().front()->refuse("the trajectory has no points");
  for (std::size_t member = 0; member < axes().size(); ++member) {
    for (std::size_t index = 0; index < points.size(); ++index) {
      takePoint(member, index, points[index]);
    }
  }
}

void TrajectoryCourse::takePoint(std::size_t member, std::size_t index, const CoursePoint& point) {
  const Axis::Impl& axis = *axes()[member];
  const std::string name = "point " + std::to_string(index) + " of the trajectory ";
  const auto refuse = [&](const std::string& why) { axis.refuse(name + why); };
  const auto check = [&](const std::vector<double>& numbers, const char* what, bool optional) {
    if (optional && numbers.empty()) return;
    if (numbers.size() != axes().size()) {
      refuse("has " + std::to_string(numbers.size()) + " " + what + ", but must have " +
             std::to_string(axes().size()) + (optional ? " or none" : ""));
    }
    if (!std::isfinite(numbers[member])) {
      refuse("has " + numberText(numbers[member]) + " among its " + what +
             ", but they must be finite");
    }
  };
  check(point.positions, "positions", false);
  check(point.velocities, "velocities", true);
  check(point.accelerations, "accelerations", true);
  constexpr double kLongest = motion::Profile::kLongest;
  if (!(point.time >= 0.0 && point.time < kLongest)) {
    refuse("is at " + numberText(point.time) + " s, but must be from 0 s to " +
           numberText(kLongest) + " s");
  }
  motion::Waypoint waypoint;
  waypoint.time_ns = std::llround(point.time * 1e9);
  auto& before = waypoints_[member];
  if (!before.empty() && waypoint.time_ns <= before.back().time_ns) {
    refuse("is at " + numberText(point.time) + " s, but must be later than the one before it, at " +
           roughText(static_cast<double>(before.back().time_ns) * 1e-9) + " s");
  }
  axis.refuseBeyondLimits(point.positions[member], name + "at");
  waypoint.position = axis.countOf(point.positions[member]);
  if (!point.velocities.empty()) {
    waypoint.velocity = point.velocities[member] * axis.stepsPerUnit();
  }
  if (!point.accelerations.empty()) {
    waypoint.acceleration = point.accelerations[member] * axis.stepsPerUnit();
  }
  before.push_back(waypoint);
}

std::vector<std::int64_t> TrajectoryCourse::targets() const {
  std::vector<std::int64_t> targets;
  for (const auto& waypoints : waypoints_) {
    targets.push_back(std::llround(std::nearbyint(waypoints.back().position)));
  }
  return targets;
}

void TrajectoryCourse::start(std::int64_t at_ns) {
  curves_.clear();
  most_.clear();
  for (std::size_t member = 0; member < axes().size(); ++member) {
    Axis::Impl& axis = *axes()[member];
    if (!axis.moving()) requireStart(member);
    const motion::MotionState motor = axis.stateAt(at_ns);
    const double count = motor.position.value();
    const double slack = count - axis.jointAt(count);
    const motion::MotionState joint{motor.position - slack, motor.velocity, motor.acceleration};
    try {
      const motion::Profile curve = motion::planSpline(0, joint, waypoints_[member]);
      requirePositions(member, curve);
      requireSmooth(member, motion::splineJerk(joint, waypoints_[member]));
      curves_.push_back(motorOf(member, curve, slack));
    } catch (const std::invalid_argument& error) {
      axis.refuse(error.what());
    }
    requireLimits(member, motor.velocity);
  }
  endTogether();
}

// What takes up a backlash at the end may last longer than the trajectory.
void TrajectoryCourse::endTogether() {
  DoubleDouble longest;
  for (const motion::Profile& curve : curves_) longest = std::max(longest, curve.duration());
  for (motion::Profile& curve : curves_) curve = motion::part(curve, 0.0, longest);
}

motion::Profile TrajectoryCourse::motorOf(std::size_t member, const motion::Profile& joint,
                                          double slack) const {
  const Axis::Impl& axis = *axes()[member];
  if (axis.backlash() == 0) return joint;
  motion::MotionLimits limits = axis.limits(axis.maxSpeed());
  limits.acceleration = mostAcceleration(limits);
  motion::MotorPlan plan = motion::planMotor(joint, slack, axis.backlash(), limits);
  if (plan.no_room) {
    axis.refuse("the trajectory turns " + at(*plan.no_room) +
                ", and goes on so close to the axis's limits that its backlash of " +
                axis.show(axis.config.backlash) + " can't be taken up meanwhile");
  }
  return std::move(plan.profile);
}

// At rest a first point at time 0 says where the trajectory believes the axis to be.
void TrajectoryCourse::requireStart(std::size_t member) const {
  Axis::Impl& axis = *axes()[member];
  const motion::Waypoint& first = waypoints_[member].front();
  if (first.time_ns != 0 || waypoints_[member].size() == 1) return;
  const double count = static_cast<double>(axis.jointCount());
  if (std::abs(first.position - count) <= axis.microsteps) return;
  axis.refuse("the trajectory begins at " + axis.show(axis.positionOf(first.position)) +
              ", but the axis stands at " + axis.show(axis.positionOf(count)) +
              "; they may differ by one full step");
}

void TrajectoryCourse::requirePositions(std::size_t member, const motion::Profile& joint) const {
  const Axis::Impl& axis = *axes()[member];
  const motion::ProfilePeaks peaks = motion::profilePeaks(joint);
  for (const motion::Peak& peak : {peaks.lowest, peaks.highest}) {
    axis.refuseBeyondLimits(axis.positionOf(peak.value),
                            "the trajectory's position " + at(peak.time_s) + ",");
  }
}

void TrajectoryCourse::requireWithin(std::size_t member, const motion::Peak& peak, double most,
                                     const char* what, const char* per) const {
  if (std::abs(peak.value) <= most * (1.0 + Coordination::kTolerance)) return;
  const Axis::Impl& axis = *axes()[member];
  const double scale = axis.stepsPerUnit();
  axis.refuse("the trajectory's " + std::string(what) + " is " +
              axis.show(peak.value / scale, per) + " " + at(peak.time_s) + ", but the axis has " +
              axis.show(most / scale, per));
}

void TrajectoryCourse::requireSmooth(std::size_t member, const motion::SplineJerk& jerk) const {
  const Axis::Impl& axis = *axes()[member];
  const motion::MotionLimits limits = axis.limits(axis.maxSpeed());
  if (limits.jerk == 0.0) return;
  const motion::Peak& jump = jerk.acceleration_jump;
  if (std::abs(jump.value) > Coordination::kTolerance * mostAcceleration(limits)) {
    axis.refuse("the trajectory's acceleration jumps by " +
                axis.show(jump.value / axis.stepsPerUnit(), "/s^2") + " " + at(jump.time_s) +
                ", but the axis has a jerk limit: all points must have velocities and "
                "accelerations, 0 at the last");
  }
  requireWithin(member, jerk.jerk, limits.jerk, "jerk", "/s^3");
}

void TrajectoryCourse::requireLimits(std::size_t member, double velocity_before) {
  const Axis::Impl& axis = *axes()[member];
  const motion::ProfilePeaks peaks = motion::profilePeaks(curves_[member], velocity_before);
  const motion::MotionLimits limits = axis.limits(axis.maxSpeed());
  const double acceleration = mostAcceleration(limits);
  requireWithin(member, peaks.velocity, limits.max_speed, "velocity", "/s");
  requireWithin(member, peaks.acceleration, acceleration, "acceleration", "/s^2");
  // A jump of less than a microstep/s is rounding.
  motion::Peak jump = peaks.velocity_jump;
  if (std::abs(jump.value) < 1.0) jump.value = 0.0;
  requireWithin(member, jump, limits.start_speed, "jump of the velocity", "/s");
  // What it has itself it may have again.
  constexpr double kMore = 1.0 + Coordination::kTolerance;
  motion::AlongLimits most{std::max(acceleration * kMore, std::abs(peaks.acceleration.value)),
                           limits.jerk * kMore};
  for (const motion::Piece& piece : curves_[member].pieces()) {
    if (limits.jerk > 0.0) most.jerk = std::max(most.jerk, std::abs(piece.j));
  }
  most_.push_back(most);
}

motion::MotionState TrajectoryCourse::begin() const { return {0.0, 1.0, 0.0}; }

motion::Profile TrajectoryCourse::plan(std::int64_t at_ns, const motion::MotionState& from,
                                       double speed_override) const {
  return changeRate(at_ns, from, std::min(speed_override, 1.0), most_);
}

motion::Profile TrajectoryCourse::planStop(std::int64_t at_ns,
                                           const motion::MotionState& from) const {
  std::vector<motion::AlongLimits> most = most_;
  for (std::size_t member = 0; member < most.size(); ++member) {
    double& acceleration = most[member].acceleration;
    acceleration = std::max(acceleration, axes()[member]->stopDeceleration());
  }
  return changeRate(at_ns, from, 0.0, most);
}

// As fast as no axis gets more acceleration and jerk than it may have: now, or where one of them
// has all of it already, as soon as it leaves some. Where that is never, the trajectory goes on
// nearly as it is: it ends at rest too.
motion::Profile TrajectoryCourse::changeRate(std::int64_t at_ns, const motion::MotionState& from,
                                             double rate,
                                             const std::vector<motion::AlongLimits>& most) const {
  const DoubleDouble end = curves_.front().duration();
  if (from.velocity == rate && from.acceleration == 0.0) {
    return motion::planRate(at_ns, from, rate, {1.0, 1.0}, 0.0, end);
  }
  const double left = (end - from.position).value();
  std::optional<motion::Profile> best;
  double soonest = std::numeric_limits<double>::infinity();
  double delay = 0.0;
  do {
    motion::RateLimits limits = steepest(from, delay, most);
    for (int i = 0; i < kTries; ++i, limits.slope *= kGentler, limits.jerk *= kGentler) {
      motion::Profile path = motion::planRate(at_ns, from, rate, limits, delay, end);
      const double time = timeToRate(path, rate);
      if (time >= soonest) break;
      const bool last_resort = delay == 0.0 && i + 1 == kTries;
      if (!last_resort && !keeps(motion::part(path, 0.0, time), most)) continue;
      best = std::move(path);
      soonest = last_resort ? soonest : time;
      break;
    }
    delay = std::max(kFirstDelay, 2.0 * delay);
  } while (delay < soonest && delay * from.velocity < left && from.velocity > 0.0);
  return *std::move(best);
}

motion::RateLimits TrajectoryCourse::steepest(const motion::MotionState& from, double delay,
                                              const std::vector<motion::AlongLimits>& most) const {
  const DoubleDouble place = from.position + DoubleDouble(delay * from.velocity);
  motion::RateLimits limits{kSteepest, 0.0};
  for (std::size_t member = 0; member < curves_.size(); ++member) {
    const auto state = curves_[member].stateAt(motion::splitNanoseconds(place).whole);
    const double speed = std::abs(state.velocity);
    if (most[member].jerk > 0.0) {
      const double jerk = speed > 0.0 ? 2.0 * most[member].jerk / speed : kSteepestJerk;
      limits.jerk = std::min(limits.jerk > 0.0 ? limits.jerk : kSteepestJerk, jerk);
    }
    if (speed > 0.0) limits.slope = std::min(limits.slope, 2.0 * most[member].acceleration / speed);
  }
  return limits;
}

bool TrajectoryCourse::keeps(const motion::Profile& path,
                             const std::vector<motion::AlongLimits>& most) const {
  for (std::size_t member = 0; member < curves_.size(); ++member) {
    if (!motion::staysWithin(curves_[member], path, most[member])) return false;
  }
  return true;
}

motion::Profile TrajectoryCourse::profileOf(std::size_t member, const motion::Profile& path) const {
  return motion::along(curves_[member], path);
}

}  // namespace stepdriver::axis
