#include "trajectory_course.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "message_text.h"
#include "stepdriver_core/motion/along.h"
#include "stepdriver_core/motion/profile_peaks.h"

namespace stepdriver::axis {
namespace {

using motion::DoubleDouble;

constexpr double kSteepest = 1000.0;  // 1/s: from full rate to none in a millisecond
constexpr double kGentler = 0.8;
constexpr int kTries = 60;  // down to a millionth of the steepest

std::string at(double seconds) { return roughText(seconds) + " s after its start"; }

// A rate that changes evenly to another, at the latest up to the end of the trajectory.
motion::Piece ramp(DoubleDouble place, double from, double to, double slope, DoubleDouble end) {
  const double change = std::copysign(slope, to - from);
  motion::Piece piece{DoubleDouble(to - from) / DoubleDouble(change), place, from, change, 0.0};
  const DoubleDouble left = end - place;
  if (left < piece.positionAt(piece.duration) - place) {
    // 2 x / (v + sqrt(v^2 + 2 a x)) cancels nothing.
    const DoubleDouble root =
        sqrt(abs(DoubleDouble(from) * DoubleDouble(from) + DoubleDouble(2.0 * change) * left));
    piece.duration = DoubleDouble(2.0) * left / (DoubleDouble(from) + root);
  }
  return piece;
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
  accelerations_.clear();
  for (std::size_t member = 0; member < axes().size(); ++member) {
    Axis::Impl& axis = *axes()[member];
    const bool moving = axis.moving();
    if (!moving) requireStart(member);
    const motion::MotionState from = axis.stateAt(at_ns);
    try {
      curves_.push_back(motion::planSpline(0, from, waypoints_[member]));
    } catch (const std::invalid_argument& error) {
      axis.refuse(error.what());
    }
    requireLimits(member, from.velocity);
  }
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

void TrajectoryCourse::requireLimits(std::size_t member, double velocity_before) {
  const Axis::Impl& axis = *axes()[member];
  const motion::ProfilePeaks peaks = motion::profilePeaks(curves_[member], velocity_before);
  const motion::MotionLimits limits = axis.limits(axis.maxSpeed());
  const double scale = axis.stepsPerUnit();
  for (const motion::Peak& peak : {peaks.lowest, peaks.highest}) {
    axis.refuseBeyondLimits(axis.positionOf(peak.value),
                            "the trajectory's position " + at(peak.time_s) + ",");
  }
  const auto require = [&](const motion::Peak& peak, double most, const char* what,
                           const char* per) {
    if (std::abs(peak.value) <= most * (1.0 + Coordination::kTolerance)) return;
    axis.refuse("the trajectory's " + std::string(what) + " is " +
                axis.show(peak.value / scale, per) + " " + at(peak.time_s) + ", but the axis has " +
                axis.show(most / scale, per));
  };
  const double acceleration = std::max(limits.acceleration, limits.deceleration);
  require(peaks.velocity, limits.max_speed, "velocity", "/s");
  require(peaks.acceleration, acceleration, "acceleration", "/s^2");
  // A jump of less than a microstep/s is rounding.
  motion::Peak jump = peaks.velocity_jump;
  if (std::abs(jump.value) < 1.0) jump.value = 0.0;
  require(jump, limits.start_speed, "jump of the velocity", "/s");
  accelerations_.push_back(std::max(acceleration, std::abs(peaks.acceleration.value)));
}

motion::MotionState TrajectoryCourse::begin() const { return {0.0, 1.0, 0.0}; }

motion::Profile TrajectoryCourse::plan(std::int64_t at_ns, const motion::MotionState& from,
                                       double speed_override) const {
  return changeRate(at_ns, from, std::min(speed_override, 1.0), accelerations_);
}

motion::Profile TrajectoryCourse::planStop(std::int64_t at_ns,
                                           const motion::MotionState& from) const {
  std::vector<double> most = accelerations_;
  for (std::size_t member = 0; member < most.size(); ++member) {
    most[member] = std::max(most[member], axes()[member]->stopDeceleration());
  }
  return changeRate(at_ns, from, 0.0, most);
}

// As fast as no axis gets more acceleration than it may have. Where it has all of it already, the
// trajectory goes on as it is: it ends at rest too.
motion::Profile TrajectoryCourse::changeRate(std::int64_t at_ns, const motion::MotionState& from,
                                             double rate, const std::vector<double>& most) const {
  const DoubleDouble end = curves_.front().duration();
  const double now = from.velocity;
  double wanted = rate;
  std::vector<motion::Piece> pieces;
  double slope = steepest(from.position, most);
  for (int i = 0; now != rate && i < kTries; ++i, slope *= kGentler) {
    pieces = {ramp(from.position, now, rate, slope, end)};
    if (keeps({at_ns, pieces}, most)) break;
    if (i + 1 == kTries && now > 0.0) {
      pieces.clear();
      wanted = now;
    }
  }
  const DoubleDouble place =
      pieces.empty() ? from.position : pieces.back().positionAt(pieces.back().duration);
  if (const DoubleDouble left = end - place; wanted > 0.0 && left.hi > 1e-12) {
    pieces.push_back({left / DoubleDouble(wanted), place, wanted, 0.0, 0.0});
  }
  if (pieces.empty()) return {at_ns, place};
  return {at_ns, std::move(pieces)};
}

double TrajectoryCourse::steepest(DoubleDouble place, const std::vector<double>& most) const {
  double slope = kSteepest;
  for (std::size_t member = 0; member < curves_.size(); ++member) {
    const motion::MotionState state =
        curves_[member].stateAt(motion::splitNanoseconds(place).whole);
    if (state.velocity != 0.0)
      slope = std::min(slope, 2.0 * most[member] / std::abs(state.velocity));
  }
  return slope;
}

bool TrajectoryCourse::keeps(const motion::Profile& path, const std::vector<double>& most) const {
  for (std::size_t member = 0; member < curves_.size(); ++member) {
    const motion::ProfilePeaks peaks = motion::profilePeaks(motion::along(curves_[member], path));
    if (std::abs(peaks.acceleration.value) > most[member] * (1.0 + 1e-9)) return false;
  }
  return true;
}

motion::Profile TrajectoryCourse::profileOf(std::size_t member, const motion::Profile& path) const {
  return motion::along(curves_[member], path);
}

}  // namespace stepdriver::axis
