#include "prepared_trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "count_rounding.h"
#include "give_way.h"
#include "interpolation.h"
#include "line_path.h"
#include "message_text.h"
#include "microstep_shift.h"
#include "nanoseconds.h"
#include "point_to_point/move_between.h"
#include "point_to_point/planner.h"
#include "profile/errors.h"
#include "profile/profile_parts.h"
#include "profile/resting_count.h"
#include "spline_checks.h"

namespace stepdriver::motion {
namespace {

// The slowed trajectory may use the limits up to the values that the trajectory itself reaches.
constexpr double kMore = 1.0 + kTrajectoryTolerance;
// How many pieces may be planned again on joining if the prepared ones can't be used.
constexpr std::size_t kFewPieces = 5000;
// If the axes are at rest, the second attempt to slow a trajectory down is right. If they move, the
// velocity at the start stays: its acceleration falls by k instead of k^2, so each attempt about
// halves the logarithm of what is missing.
constexpr int kMostSlowdowns = 30;
// [s] A trajectory isn't made longer than this.
constexpr double kLongestSlowed = Profile::kLongest / 4.0;
// A motion that is slowed down leaves this part of the limits of an axis for its backlash.
constexpr double kShareForBacklash = 0.2;

// Says how a refused trajectory could be followed; empty if that isn't known. It takes as long as
// planning the trajectory, so it is called only for a refusal.
using Remedy = std::function<std::string()>;

std::string pointText(std::size_t index) {
  return fmt::format("point {} of the trajectory", index);
}

std::string at(double seconds) { return roughText(seconds) + " s after its start"; }

Peak later(Peak peak, double seconds) {
  peak.time_s += seconds;
  return peak;
}

void requireWithin(const PathAxis& axis, const Peak& peak, double most, const char* what,
                   const char* per, const Remedy& remedy,
                   std::optional<config::LimitSource> source = {}) {
  if (std::abs(peak.value) <= most * kMore) return;
  const double scale = axis.steps_per_unit;
  axis.refuse(fmt::format(
      "the trajectory's {} is {} {}, but the axis has {}{}", what,
      axis.show(peak.value / scale, per), at(peak.time_s),
      source ? axis.showLimit(most / scale, *source, per) : axis.show(most / scale, per),
      remedy()));
}

void requirePositions(const PathAxis& axis, const ProfilePeaks& joint, double begin) {
  for (const Peak& peak : {joint.lowest, joint.highest}) {
    axis.refuseBeyondLimits(axis.positionOf(peak.value),
                            fmt::format("the trajectory's position {},", at(begin + peak.time_s)));
  }
}

void requireSmooth(const PathAxis& axis, const SplineJerk& jerk, double begin,
                   const Remedy& remedy) {
  if (axis.limits.jerk == 0.0) return;
  const Peak& jump = jerk.acceleration_jump;
  if (std::abs(jump.value) > kTrajectoryTolerance * axis.mostAcceleration()) {
    axis.refuse(
        fmt::format("the trajectory's acceleration jumps by {} {}, but the axis has a jerk limit: "
                    "all points must have velocities and accelerations, 0 at the last",
                    axis.show(jump.value / axis.steps_per_unit, "/s^2"), at(begin + jump.time_s)));
  }
  requireWithin(axis, later(jerk.jerk, begin), axis.limits.jerk, "jerk", "/s^3", remedy);
}

void requireLimits(const PathAxis& axis, const ProfilePeaks& motor, double begin,
                   const Remedy& remedy) {
  requireWithin(axis, later(motor.velocity, begin), axis.limits.max_speed, "velocity", "/s", remedy,
                axis.max_speed_source);
  requireWithin(axis, later(motor.acceleration, begin), axis.mostAcceleration(), "acceleration",
                "/s^2", remedy);
  // A jump of less than a microstep/s is rounding.
  Peak jump = later(motor.velocity_jump, begin);
  if (std::abs(jump.value) < 1.0) jump.value = 0.0;
  requireWithin(axis, jump, axis.limits.start_speed, "jump of the velocity", "/s",
                [] { return std::string(); });
}

double shareOfJoint(const PathAxis& axis) {
  return axis.backlash > 0 ? 1.0 - kShareForBacklash : 1.0;
}

// The smallest factor on the times of a curve that keeps it within the limits; 1 if it does so
// already. A factor k divides velocities by k, accelerations by k^2 and jerks by k^3.
double slowdownOf(const PathAxis& axis, const ProfilePeaks& peaks, const SplineJerk& jerk) {
  double factor = 1.0;
  const auto include = [&](const Peak& peak, double most, double order) {
    const double excess = std::abs(peak.value) / (most * shareOfJoint(axis));
    if (excess > kMore) factor = std::max(factor, std::pow(excess, 1.0 / order));
  };
  include(peaks.velocity, axis.limits.max_speed, 1.0);
  include(peaks.acceleration, axis.mostAcceleration(), 2.0);
  if (axis.limits.jerk > 0.0) include(jerk.jerk, axis.limits.jerk, 3.0);
  return factor;
}

std::string remedyText(double shortest, double wanted) {
  return fmt::format("; with allow_slower it takes {} s instead of {} s", lowerBoundText(shortest),
                     roughText(wanted));
}

[[noreturn]] void refuseTurn(const PathAxis& axis, double time_s) {
  axis.refuse(
      fmt::format("the trajectory turns {}, and continues so close to the axis's limits that its "
                  "backlash of {} can't be taken up meanwhile",
                  at(time_s), axis.show(axis.configured_backlash)));
}

// If the axis is at rest, a first point at time 0 says where the trajectory assumes it to be.
void requireStart(const PathAxis& axis, const Waypoint& first, const PathStart& start) {
  const double count =
      static_cast<double>(restingCount(start.motor.position.value())) - start.slack;
  if (std::abs(first.position - count) <= axis.microsteps) return;
  axis.refuse(fmt::format(
      "the trajectory begins at {}, but the axis stands at {}; they may differ by one full step",
      axis.showPlace(axis.positionOf(first.position)), axis.showPlace(axis.positionOf(count))));
}

// The number of an axis in a point.
double finiteOf(const PathAxis& axis, std::size_t member, std::size_t point,
                const std::vector<double>& numbers, const char* what) {
  const double number = numbers[member];
  if (!std::isfinite(number)) {
    axis.refuse(fmt::format("{} has {} among its {}, but they must be finite", pointText(point),
                            numberText(number), what));
  }
  return number;
}

double jerkOf(const Profile& profile) {
  double jerk = 0.0;
  for (const Piece& piece : profile.pieces()) jerk = std::max(jerk, std::abs(piece.j));
  return jerk;
}

void widen(MotorBounds& bounds, const PathAxis& axis, const ProfilePeaks& peaks,
           const Profile& profile) {
  bounds.acceleration = std::max(bounds.acceleration, std::abs(peaks.acceleration.value));
  if (axis.limits.jerk > 0.0) bounds.jerk = std::max(bounds.jerk, jerkOf(profile));
}

MotionState jointOf(const PathStart& start) {
  return {start.motor.position - start.slack, start.motor.velocity, start.motor.acceleration};
}

double endVelocity(const Profile& profile) {
  const Piece last = profile.pieces().back();
  return last.velocityAt(last.duration).value();
}

}  // namespace

PreparedTrajectory::PreparedTrajectory(std::vector<PathAxis> axes,
                                       const std::vector<TrajectoryPoint>& points,
                                       const std::vector<MotionState>& expected, bool allow_slower,
                                       std::shared_ptr<const PathMarks> marks)
    : axes_(std::move(axes)), allow_slower_(allow_slower), marks_(std::move(marks)) {
  if (points.empty()) axes_.front().refuse("the trajectory has no points");
  requirePoints(points);
  lone_position_ = onlyPositionsCount(points);
  has_velocities_ = std::none_of(points.begin(), points.end(), [](const TrajectoryPoint& point) {
    return point.velocities.empty();
  });
  std::vector<TrajectoryPoint> positions;
  if (lone_position_ && !points.front().velocities.empty()) {
    const TrajectoryPoint& point = points.front();
    for (std::size_t member = 0; member < axes_.size(); ++member) {
      finiteOf(axes_[member], member, 0, point.velocities, "velocities");
      if (!point.accelerations.empty()) {
        finiteOf(axes_[member], member, 0, point.accelerations, "accelerations");
      }
    }
    positions.push_back({point.time, point.positions, {}, {}});
  }
  Source source{positions.empty() ? points : positions, expected};
  const bool moves = std::any_of(expected.begin(), expected.end(),
                                 [](const auto& state) { return state.velocity != 0.0; });
  // These have only a way from the start, which join() plans.
  const bool only_way = lone_position_ || (points.size() == 1 && moves);
  if (allow_slower_ && !only_way) source.slowdown = slowdownFor(source).value_or(1.0);
  parts_.reserve(axes_.size());
  for (std::size_t member = 0; member < axes_.size(); ++member) {
    parts_.push_back(prepare(member, source));
  }
}

// A stream of single points with velocities, as MoveIt Servo sends them: the axes don't keep the
// velocity, because they come to rest if no other point follows. A cubic would make the
// acceleration jump.
bool PreparedTrajectory::onlyPositionsCount(const std::vector<TrajectoryPoint>& points) const {
  if (points.size() > 1) return false;
  const TrajectoryPoint& point = points.front();
  if (point.velocities.empty()) return true;
  if (!allow_slower_) return false;
  const auto is_smooth = [](const PathAxis& axis) { return axis.limits.jerk > 0.0; };
  return std::any_of(point.velocities.begin(), point.velocities.end(),
                     [](double velocity) { return velocity != 0.0; }) ||
         (point.accelerations.empty() && std::any_of(axes_.begin(), axes_.end(), is_smooth));
}

std::optional<double> PreparedTrajectory::slowdownFor(Source source) const {
  for (int i = 0; i < kMostSlowdowns; ++i) {
    double more = 1.0;
    for (std::size_t member = 0; member < axes_.size(); ++member) {
      const PathAxis& axis = axes_[member];
      const MotionState& from = source.expected[member];
      const std::vector<Waypoint> waypoints = waypointsOf(member, source);
      try {
        const Profile curve = planSpline(0, from, waypoints, curveLimits(member));
        more = std::max(more, slowdownOf(axis, profilePeaks(curve), splineJerk(from, waypoints)));
      } catch (const Malformed& error) {
        axis.refuse(error.what());
      }
    }
    if (more == 1.0) return source.slowdown;
    source.slowdown *= more;
    if (!(source.duration() <= kLongestSlowed)) break;
  }
  return std::nullopt;
}

// Refuses points whose sizes or times are wrong, which is the same for all axes.
void PreparedTrajectory::requirePoints(const std::vector<TrajectoryPoint>& points) const {
  const PathAxis& axis = axes_.front();
  for (std::size_t i = 0; i < points.size(); ++i) {
    giveWayAt(i);
    const TrajectoryPoint& point = points[i];
    const auto check = [&](std::size_t size, const char* what, bool optional) {
      if (size == axes_.size() || (optional && size == 0)) return;
      axis.refuse(fmt::format("{} has {} {}, but must have {}{}", pointText(i), size, what,
                              axes_.size(), optional ? " or none" : ""));
    };
    check(point.positions.size(), "positions", false);
    check(point.velocities.size(), "velocities", true);
    check(point.accelerations.size(), "accelerations", true);
    constexpr double kLongest = Profile::kLongest;
    if (!(point.time >= 0.0 && point.time < kLongest)) {
      axis.refuse(fmt::format("{} is at {} s, but must be from 0 s to {} s", pointText(i),
                              numberText(point.time), numberText(kLongest)));
    }
    if (i > 0 && nanoseconds(point.time) <= nanoseconds(points[i - 1].time)) {
      axis.refuse(
          fmt::format("{} is at {} s, but must be later than the one before it, at {} s",
                      pointText(i), numberText(point.time),
                      roughText(static_cast<double>(nanoseconds(points[i - 1].time)) * 1e-9)));
    }
  }
}

std::vector<Waypoint> PreparedTrajectory::waypointsOf(std::size_t member,
                                                      const Source& source) const {
  const PathAxis& axis = axes_[member];
  std::vector<Waypoint> waypoints(source.points.size());
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    giveWayAt(i);
    const TrajectoryPoint& point = source.points[i];
    const auto read = [&](const std::vector<double>& numbers, const char* what) {
      return finiteOf(axis, member, i, numbers, what);
    };
    Waypoint& waypoint = waypoints[i];
    waypoint.time_ns = nanoseconds(source.slowdown * point.time);
    const double position = read(point.positions, "positions");
    axis.refuseBeyondLimits(position, [&] { return pointText(i) + " at"; });
    waypoint.position = withoutRounding(axis.countOf(position));
    if (!point.velocities.empty()) {
      waypoint.velocity =
          read(point.velocities, "velocities") * axis.steps_per_unit / source.slowdown;
    }
    if (!point.accelerations.empty()) {
      waypoint.acceleration = read(point.accelerations, "accelerations") * axis.steps_per_unit /
                              (source.slowdown * source.slowdown);
    }
  }
  waypoints.back().may_rest = axis.shares_motors;
  try {
    requireWaypoints(waypoints);
  } catch (const Malformed& error) {
    axis.refuse(error.what());
  }
  const MotionState& from = source.expected[member];
  return interpolate(
      from,
      shiftedToMicrosteps(from, std::move(waypoints), axis.mostAcceleration(), axis.limits.jerk),
      axis.limits.jerk > 0.0 ? Smoothness::kJerk : Smoothness::kAcceleration);
}

MotionLimits PreparedTrajectory::motorLimits(std::size_t member) const {
  MotionLimits limits = axes_[member].limits;
  limits.acceleration = axes_[member].mostAcceleration();
  return limits;
}

SplineLimits PreparedTrajectory::curveLimits(std::size_t member) const {
  const PathAxis& axis = axes_[member];
  SplineLimits limits{axis.mostAcceleration(), axis.limits.max_speed};
  if (has_velocities_ && axis.limits.jerk == 0.0) limits.gentler_beyond = kMore;
  return limits;
}

PreparedTrajectory::Part PreparedTrajectory::prepare(std::size_t member,
                                                     const Source& source) const {
  const PathAxis& axis = axes_[member];
  const auto remedy = [&]() -> std::string {
    if (allow_slower_) return {};
    Source slower = source;
    slower.slowdown = slowdownFor(source).value_or(1.0);
    return slower.slowdown > 1.0 ? remedyText(slower.duration(), source.duration()) : std::string();
  };
  const std::vector<Waypoint> waypoints = waypointsOf(member, source);
  Part part;
  part.ends = {waypoints.front(), waypoints.back()};
  part.target = axis.countOf(source.points.back().positions[member]);
  part.begins_at_start = waypoints.size() > 1 && waypoints.front().time_ns == 0;
  part.bounds = {axis.mostAcceleration() * kMore, axis.limits.jerk * kMore};
  try {
    part.spline = std::make_unique<const SplineTail>(waypoints, curveLimits(member));
  } catch (const Malformed& error) {
    axis.refuse(error.what());
  }
  const Profile* joint = part.spline->profile();
  if (joint == nullptr) return part;
  const double begin = part.spline->beginS();
  const ProfilePeaks joint_peaks = profilePeaks(*joint, joint->piece(0).v0);
  requirePositions(axis, joint_peaks, begin);
  requireSmooth(axis, part.spline->jerk(), begin, remedy);
  if (axis.backlash == 0) {
    requireLimits(axis, joint_peaks, begin, remedy);
    widen(part.bounds, axis, joint_peaks, *joint);
    return part;
  }
  part.motor = std::make_unique<const MotorTail>(*joint, axis.backlash, motorLimits(member));
  if (const auto time = part.motor->noRoom()) refuseTurn(axis, begin + *time);
  const Profile& motor = part.motor->profile();
  const ProfilePeaks peaks = profilePeaks(motor, motor.piece(0).v0);
  requireLimits(axis, peaks, begin, remedy);
  widen(part.bounds, axis, peaks, motor);
  return part;
}

MotorPlan PreparedTrajectory::planWhole(std::size_t member, const Profile& joint,
                                        double slack) const {
  if (joint.pieceCount() > kFewPieces) {
    axes_[member].refuse(
        "the trajectory can't begin from here: it turns so often that its backlash is never "
        "taken up; let the axis come to rest before the first point");
  }
  return planMotor(joint, slack, axes_[member].backlash, motorLimits(member));
}

PreparedTrajectory::Head PreparedTrajectory::headOf(std::size_t member,
                                                    const PathStart& start) const {
  const SplineTail& spline = *parts_[member].spline;
  const MotionState from = jointOf(start);
  try {
    return {spline.head(from), spline.headJerk(from)};
  } catch (const Malformed& error) {
    axes_[member].refuse(error.what());
  }
}

std::vector<Piece> PreparedTrajectory::quickestTo(std::size_t member,
                                                  const PathStart& start) const {
  const PathAxis& axis = axes_[member];
  MotionLimits limits = axis.limits;
  for (double* limit :
       {&limits.max_speed, &limits.acceleration, &limits.deceleration, &limits.jerk}) {
    *limit *= shareOfJoint(axis);
  }
  limits.start_speed = std::min(limits.start_speed, limits.max_speed);
  const Waypoint& point = parts_[member].ends.back();
  const MotionState from = jointOf(start);
  std::vector<Piece> pieces;
  try {
    const Profile plan = planMove(0, from, axis.restAt(point.position), limits).profile;
    for (const Piece& piece : plan.pieces()) pieces.push_back(piece);
  } catch (const TooLong& error) {
    axis.refuse(error.what());
  }
  // An axis that is already there waits for the others.
  if (pieces.empty()) pieces.push_back({DoubleDouble(1e-9), from.position});
  return pieces;
}

TrajectoryPath::Member PreparedTrajectory::joinMember(
    const std::shared_ptr<const PreparedTrajectory>& own, std::size_t member,
    const PathStart& start, const Head& given, const std::function<std::string()>& remedy) const {
  const PathAxis& axis = axes_[member];
  const Part& part = parts_[member];
  if (!start.moves && part.begins_at_start) requireStart(axis, part.ends.front(), start);
  const std::vector<Piece>& pieces = given.pieces;
  const Profile head(0, pieces);
  const DoubleDouble begin = head.duration();
  const Profile* tail = part.spline->profile();
  requirePositions(axis, profilePeaks(head), 0.0);
  requireSmooth(axis, given.jerk, 0.0, remedy);

  Sections sections;
  sections.add(pieces);
  if (tail != nullptr) {
    sections.add(Excerpt{{own, tail}, 0.0, tail->duration()});
  }
  const auto joint = std::make_shared<const Profile>(0, std::move(sections));
  std::shared_ptr<const Profile> motor = joint;
  std::vector<JoinedMotor::Stretch> fresh{{0.0, begin.value()}};
  if (axis.backlash > 0) {
    std::optional<JoinedMotor> joined;
    if (tail != nullptr) {
      joined = part.motor->join({own, part.motor.get()}, joint, begin, start.slack);
    }
    if (!joined) {
      MotorPlan whole = planWhole(member, *joint, start.slack);
      const double end = whole.profile.duration().value();
      joined = JoinedMotor{std::move(whole.profile), {{0.0, end}}, whole.no_room};
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
        profilePeaks(planned, first ? start.motor.velocity : planned.piece(0).v0,
                     to_rest ? 0.0 : endVelocity(planned) + seam);
    peaks = first ? own_peaks : joinPeaks(peaks, own_peaks, stretch.from);
    widen(made.bounds, axis, own_peaks, planned);
    first = false;
  }
  requireLimits(axis, peaks, 0.0, remedy);
  made.stop_bounds = made.bounds;
  made.stop_bounds.acceleration = std::max(made.bounds.acceleration, axis.stop_limits.deceleration);
  made.stop_bounds.jerk =
      axis.stop_limits.jerk > 0.0 ? std::max(made.bounds.jerk, axis.stop_limits.jerk * kMore) : 0.0;
  return made;
}

std::shared_ptr<const SharedPath> PreparedTrajectory::lineTo(
    const std::vector<PathStart>& starts) const {
  std::vector<double> targets;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const Waypoint& point = parts_[i].ends.back();
    const double joint = axes_[i].restAt(point.position);
    const double slack = starts[i].slack;
    const double way = joint + slack - starts[i].motor.position.value();
    const auto backlash = static_cast<double>(axes_[i].backlash);
    // The backlash is taken up during the motion.
    targets.push_back(joint + (way > 0.0 ? backlash : way < 0.0 ? 0.0 : slack) - slack);
  }
  const double duration = wantedDuration();
  auto quickest = std::make_shared<const LinePath>(axes_, starts, targets, 0.0, 0.0);
  const double shortest = quickest->shortestDuration();
  if (duration < shortest * (1.0 - 1e-9)) {
    if (allow_slower_) return quickest;
    axes_.front().refuse(
        fmt::format("the target can't be reached in {} s; the limits of the axes allow {} s, which "
                    "it takes with allow_slower",
                    numberText(duration), lowerBoundText(shortest)));
  }
  return std::make_shared<const LinePath>(axes_, starts, targets, 0.0, duration);
}

double PreparedTrajectory::wantedDuration() const {
  return static_cast<double>(parts_.front().ends.back().time_ns) / 1e9;
}

bool PreparedTrajectory::isOneRest() const {
  return std::all_of(parts_.begin(), parts_.end(), [](const Part& part) {
    const Waypoint& point = part.ends.back();
    return part.spline->profile() == nullptr && point.velocity.value_or(0.0) == 0.0 &&
           point.acceleration.value_or(0.0) == 0.0;
  });
}

std::shared_ptr<const SharedPath> PreparedTrajectory::join(
    const std::shared_ptr<const PreparedTrajectory>& prepared,
    const std::vector<PathStart>& starts) {
  const bool at_rest = std::none_of(starts.begin(), starts.end(),
                                    [](const PathStart& start) { return start.moves; });
  if (prepared->lone_position_ && at_rest) return prepared->lineTo(starts);
  return prepared->joinAll(prepared, starts, at_rest);
}

std::shared_ptr<const SharedPath> PreparedTrajectory::joinAll(
    const std::shared_ptr<const PreparedTrajectory>& own, const std::vector<PathStart>& starts,
    bool at_rest) const {
  std::vector<Head> heads;
  double slowdown = 1.0;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    heads.push_back(headOf(i, starts[i]));
    const ProfilePeaks peaks = profilePeaks(Profile(0, heads[i].pieces));
    slowdown = std::max(slowdown, slowdownOf(axes_[i], peaks, heads[i].jerk));
  }
  double shortest = 0.0;  // unknown
  if (slowdown > 1.0 && isOneRest() && (allow_slower_ || !at_rest)) {
    std::vector<Head> quickest;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      quickest.push_back({quickestTo(i, starts[i]), {}});
      shortest = std::max(shortest, Profile(0, quickest[i].pieces).duration().value());
    }
    if (allow_slower_) heads = std::move(quickest);
  } else if (at_rest) {
    // The rest of the trajectory is within the limits, and all of it can be slowed down alike.
    shortest = slowdown * wantedDuration();
  }
  const auto remedy = [&] {
    const bool known = !allow_slower_ && shortest > wantedDuration();
    return known ? remedyText(shortest, wantedDuration()) : std::string();
  };
  std::vector<TrajectoryPath::Member> members;
  members.reserve(starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    members.push_back(joinMember(own, i, starts[i], heads[i], remedy));
  }
  return std::make_shared<const TrajectoryPath>(std::move(members), DoubleDouble(), marks_);
}

}  // namespace stepdriver::motion
