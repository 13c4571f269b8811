#include "prepared_trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "give_way.h"
#include "line_path.h"
#include "message_text.h"
#include "motion/profile_parts.h"
#include "nanoseconds.h"

namespace stepdriver::axis {
namespace {

using motion::DoubleDouble;
using motion::Peak;
using motion::Profile;
using motion::ProfilePeaks;

// The slowed trajectory may use the limits that the trajectory itself reaches.
constexpr double kMore = 1.0 + kTrajectoryTolerance;
// How many pieces may be planned again on joining if the prepared ones can't be used.
constexpr std::size_t kFewPieces = 5000;

std::string at(double seconds) { return roughText(seconds) + " s after its start"; }

Peak later(Peak peak, double seconds) {
  peak.time_s += seconds;
  return peak;
}

void requireWithin(const PathAxis& axis, const Peak& peak, double most, const char* what,
                   const char* per, std::optional<config::LimitSource> source = {}) {
  if (std::abs(peak.value) <= most * kMore) return;
  const double scale = axis.steps_per_unit;
  axis.refuse(fmt::format(
      "the trajectory's {} is {} {}, but the axis has {}", what, axis.show(peak.value / scale, per),
      at(peak.time_s),
      source ? axis.showLimit(most / scale, *source, per) : axis.show(most / scale, per)));
}

void requirePositions(const PathAxis& axis, const ProfilePeaks& joint, double begin) {
  for (const Peak& peak : {joint.lowest, joint.highest}) {
    axis.refuseBeyondLimits(axis.positionOf(peak.value),
                            fmt::format("the trajectory's position {},", at(begin + peak.time_s)));
  }
}

void requireSmooth(const PathAxis& axis, const motion::SplineJerk& jerk, double begin) {
  if (axis.limits.jerk == 0.0) return;
  const Peak& jump = jerk.acceleration_jump;
  if (std::abs(jump.value) > kTrajectoryTolerance * axis.mostAcceleration()) {
    axis.refuse(
        fmt::format("the trajectory's acceleration jumps by {} {}, but the axis has a jerk limit: "
                    "all points must have velocities and accelerations, 0 at the last",
                    axis.show(jump.value / axis.steps_per_unit, "/s^2"), at(begin + jump.time_s)));
  }
  requireWithin(axis, later(jerk.jerk, begin), axis.limits.jerk, "jerk", "/s^3");
}

void requireLimits(const PathAxis& axis, const ProfilePeaks& motor, double begin) {
  requireWithin(axis, later(motor.velocity, begin), axis.limits.max_speed, "velocity", "/s",
                axis.max_speed_source);
  requireWithin(axis, later(motor.acceleration, begin), axis.mostAcceleration(), "acceleration",
                "/s^2");
  // A jump of less than a microstep/s is rounding.
  Peak jump = later(motor.velocity_jump, begin);
  if (std::abs(jump.value) < 1.0) jump.value = 0.0;
  requireWithin(axis, jump, axis.limits.start_speed, "jump of the velocity", "/s");
}

[[noreturn]] void refuseTurn(const PathAxis& axis, double time_s) {
  axis.refuse(
      fmt::format("the trajectory turns {}, and continues so close to the axis's limits that its "
                  "backlash of {} can't be taken up meanwhile",
                  at(time_s), axis.show(axis.configured_backlash)));
}

// At rest, a first point at time 0 gives the position that the trajectory assumes for the axis.
void requireStart(const PathAxis& axis, const motion::Waypoint& first, const PathStart& start) {
  const double count = std::round(start.motor.position.value()) - start.slack;
  if (std::abs(first.position - count) <= axis.microsteps) return;
  axis.refuse(fmt::format(
      "the trajectory begins at {}, but the axis stands at {}; they may differ by one full step",
      axis.showPlace(axis.positionOf(first.position)), axis.showPlace(axis.positionOf(count))));
}

double jerkOf(const Profile& profile) {
  double jerk = 0.0;
  for (const motion::Piece& piece : profile.pieces()) jerk = std::max(jerk, std::abs(piece.j));
  return jerk;
}

void widen(motion::MotorBounds& bounds, const PathAxis& axis, const ProfilePeaks& peaks,
           const Profile& profile) {
  bounds.acceleration = std::max(bounds.acceleration, std::abs(peaks.acceleration.value));
  if (axis.limits.jerk > 0.0) bounds.jerk = std::max(bounds.jerk, jerkOf(profile));
}

double endVelocity(const Profile& profile) {
  const motion::Piece last = profile.pieces().back();
  return last.velocityAt(last.duration).value();
}

}  // namespace

PreparedTrajectory::PreparedTrajectory(std::vector<PathAxis> axes,
                                       const std::vector<TrajectoryPoint>& points)
    : axes_(std::move(axes)) {
  if (points.empty()) axes_.front().refuse("the trajectory has no points");
  lone_position_ = points.size() == 1 && points.front().velocities.empty() &&
                   points.front().accelerations.empty();
  parts_.reserve(axes_.size());
  for (std::size_t member = 0; member < axes_.size(); ++member) {
    parts_.push_back(prepare(member, points));
  }
}

motion::Waypoint PreparedTrajectory::waypointOf(std::size_t member, std::size_t index,
                                                const TrajectoryPoint& point,
                                                const std::vector<motion::Waypoint>& before) const {
  const PathAxis& axis = axes_[member];
  // Called only for a refusal, because there are many points.
  const auto name = [&] { return fmt::format("point {} of the trajectory", index); };
  const auto check = [&](const std::vector<double>& numbers, const char* what, bool optional) {
    if (optional && numbers.empty()) return;
    if (numbers.size() != axes_.size()) {
      axis.refuse(fmt::format("{} has {} {}, but must have {}{}", name(), numbers.size(), what,
                              axes_.size(), optional ? " or none" : ""));
    }
    if (!std::isfinite(numbers[member])) {
      axis.refuse(fmt::format("{} has {} among its {}, but they must be finite", name(),
                              numberText(numbers[member]), what));
    }
  };
  check(point.positions, "positions", false);
  check(point.velocities, "velocities", true);
  check(point.accelerations, "accelerations", true);
  constexpr double kLongest = Profile::kLongest;
  if (!(point.time >= 0.0 && point.time < kLongest)) {
    axis.refuse(fmt::format("{} is at {} s, but must be from 0 s to {} s", name(),
                            numberText(point.time), numberText(kLongest)));
  }
  motion::Waypoint waypoint;
  waypoint.time_ns = nanoseconds(point.time);
  if (!before.empty() && waypoint.time_ns <= before.back().time_ns) {
    axis.refuse(fmt::format("{} is at {} s, but must be later than the one before it, at {} s",
                            name(), numberText(point.time),
                            roughText(static_cast<double>(before.back().time_ns) * 1e-9)));
  }
  axis.refuseBeyondLimits(point.positions[member], name() + " at");
  waypoint.position = axis.countOf(point.positions[member]);
  if (!point.velocities.empty()) {
    waypoint.velocity = point.velocities[member] * axis.steps_per_unit;
  }
  if (!point.accelerations.empty()) {
    waypoint.acceleration = point.accelerations[member] * axis.steps_per_unit;
  }
  return waypoint;
}

motion::MotionLimits PreparedTrajectory::motorLimits(std::size_t member) const {
  motion::MotionLimits limits = axes_[member].limits;
  limits.acceleration = axes_[member].mostAcceleration();
  return limits;
}

PreparedTrajectory::Part PreparedTrajectory::prepare(
    std::size_t member, const std::vector<TrajectoryPoint>& points) const {
  const PathAxis& axis = axes_[member];
  std::vector<motion::Waypoint> waypoints;
  waypoints.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    giveWay(i);
    waypoints.push_back(waypointOf(member, i, points[i], waypoints));
  }
  if (lone_position_) {
    // If the axis moves, it comes to rest there as smoothly as its limits require.
    waypoints.front().velocity = 0.0;
    if (axis.limits.jerk > 0.0) waypoints.front().acceleration = 0.0;
  }
  Part part;
  part.ends = {waypoints.front(), waypoints.back()};
  part.begins_at_start = waypoints.size() > 1 && waypoints.front().time_ns == 0;
  part.bounds = {axis.mostAcceleration() * kMore, axis.limits.jerk * kMore};
  try {
    part.spline = std::make_unique<const motion::SplineTail>(waypoints);
  } catch (const std::invalid_argument& error) {
    axis.refuse(error.what());
  }
  const Profile* joint = part.spline->profile();
  if (joint == nullptr) return part;
  const double begin = part.spline->beginS();
  const ProfilePeaks joint_peaks = motion::profilePeaks(*joint, joint->piece(0).v0);
  requirePositions(axis, joint_peaks, begin);
  requireSmooth(axis, part.spline->jerk(), begin);
  if (axis.backlash == 0) {
    requireLimits(axis, joint_peaks, begin);
    widen(part.bounds, axis, joint_peaks, *joint);
    return part;
  }
  part.motor =
      std::make_unique<const motion::MotorTail>(*joint, axis.backlash, motorLimits(member));
  if (const auto time = part.motor->noRoom()) refuseTurn(axis, begin + *time);
  const Profile& motor = part.motor->profile();
  const ProfilePeaks peaks = motion::profilePeaks(motor, motor.piece(0).v0);
  requireLimits(axis, peaks, begin);
  widen(part.bounds, axis, peaks, motor);
  return part;
}

motion::MotorPlan PreparedTrajectory::planWhole(std::size_t member, const Profile& joint,
                                                double slack) const {
  if (joint.pieceCount() > kFewPieces) {
    axes_[member].refuse(
        "the trajectory can't begin from here: it turns so often that its backlash is never "
        "taken up; let the axis come to rest before the first point");
  }
  return motion::planMotor(joint, slack, axes_[member].backlash, motorLimits(member));
}

TrajectoryPath::Member PreparedTrajectory::joinMember(
    const std::shared_ptr<const PreparedTrajectory>& own, std::size_t member,
    const PathStart& start) const {
  const PathAxis& axis = axes_[member];
  const Part& part = parts_[member];
  if (!start.moves && part.begins_at_start) requireStart(axis, part.ends.front(), start);
  const motion::MotionState from{start.motor.position - start.slack, start.motor.velocity,
                                 start.motor.acceleration};
  std::vector<motion::Piece> pieces;
  motion::SplineJerk jerk;
  try {
    pieces = part.spline->head(from);
    jerk = part.spline->headJerk(from);
  } catch (const std::invalid_argument& error) {
    axis.refuse(error.what());
  }
  const Profile head(0, pieces);
  const DoubleDouble begin = head.duration();
  const Profile* tail = part.spline->profile();
  requirePositions(axis, motion::profilePeaks(head), 0.0);
  requireSmooth(axis, jerk, 0.0);

  motion::Sections sections;
  sections.add(pieces);
  if (tail != nullptr) {
    sections.add(motion::Excerpt{{own, tail}, 0.0, tail->duration()});
  }
  const auto joint = std::make_shared<const Profile>(0, std::move(sections));
  std::shared_ptr<const Profile> motor = joint;
  std::vector<motion::JoinedMotor::Stretch> fresh{{0.0, begin.value()}};
  if (axis.backlash > 0) {
    std::optional<motion::JoinedMotor> joined;
    if (tail != nullptr) {
      joined = part.motor->join({own, part.motor.get()}, joint, begin, start.slack);
    }
    if (!joined) {
      motion::MotorPlan whole = planWhole(member, *joint, start.slack);
      const double end = whole.profile.duration().value();
      joined = motion::JoinedMotor{std::move(whole.profile), {{0.0, end}}, whole.no_room};
    }
    if (joined->no_room) refuseTurn(axis, *joined->no_room);
    fresh = joined->fresh;
    motor = std::make_shared<const Profile>(std::move(joined->profile));
  }

  TrajectoryPath::Member made{motor, part.bounds, {}};
  ProfilePeaks peaks;
  bool first = true;
  for (const auto& stretch : fresh) {
    const Profile planned = motion::part(*motor, stretch.from, stretch.to);
    if (planned.pieceCount() == 0) continue;
    // The backlash doesn't make the speed jump: at the beginning of the tail, only the joint does.
    const double seam = first && tail != nullptr ? tail->piece(0).v0 - endVelocity(head) : 0.0;
    const bool to_rest = first && tail == nullptr;
    const ProfilePeaks own_peaks =
        motion::profilePeaks(planned, first ? start.motor.velocity : planned.piece(0).v0,
                             to_rest ? 0.0 : endVelocity(planned) + seam);
    peaks = first ? own_peaks : motion::joinPeaks(peaks, own_peaks, stretch.from);
    widen(made.bounds, axis, own_peaks, planned);
    first = false;
  }
  requireLimits(axis, peaks, 0.0);
  made.stop_bounds = made.bounds;
  made.stop_bounds.acceleration = std::max(made.bounds.acceleration, axis.stop_limits.deceleration);
  made.stop_bounds.jerk =
      axis.stop_limits.jerk > 0.0 ? std::max(made.bounds.jerk, axis.stop_limits.jerk * kMore) : 0.0;
  return made;
}

std::shared_ptr<const SharedPath> PreparedTrajectory::lineTo(
    const std::vector<PathStart>& starts) const {
  std::vector<std::int64_t> targets;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const motion::Waypoint& point = parts_[i].ends.back();
    const std::int64_t joint = motion::restingCount(point.position);
    const std::int64_t slack = std::llround(starts[i].slack);
    const std::int64_t way = joint + slack - std::llround(starts[i].motor.position.value());
    // The backlash is taken up during the motion.
    targets.push_back(joint + (way > 0 ? axes_[i].backlash : way < 0 ? 0 : slack) - slack);
  }
  const double duration = static_cast<double>(parts_.front().ends.back().time_ns) / 1e9;
  return std::make_shared<const LinePath>(axes_, starts, targets, 0.0, duration);
}

std::shared_ptr<const SharedPath> PreparedTrajectory::join(
    const std::shared_ptr<const PreparedTrajectory>& prepared,
    const std::vector<PathStart>& starts) {
  const bool at_rest = std::none_of(starts.begin(), starts.end(),
                                    [](const PathStart& start) { return start.moves; });
  if (prepared->lone_position_ && at_rest) return prepared->lineTo(starts);
  std::vector<TrajectoryPath::Member> members;
  members.reserve(starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    members.push_back(prepared->joinMember(prepared, i, starts[i]));
  }
  return std::make_shared<const TrajectoryPath>(std::move(members));
}

}  // namespace stepdriver::axis
