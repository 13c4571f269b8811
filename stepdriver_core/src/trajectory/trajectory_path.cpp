#include "trajectory_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "feed_deceleration.h"
#include "jerk_limited_feed_deceleration.h"
#include "profile/profile_parts.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::motion {
namespace {

constexpr double kGentler = 0.8;
constexpr int kTries = 60;             // down to a millionth of the steepest slope
constexpr double kLastResort = 1e-6;   // relative to the steepest slope
constexpr double kFirstDelay = 0.010;  // [s]
// A deceleration that is as steep as each place allows has at most this many slopes, and none is
// shorter than this.
constexpr double kMostSlopes = 100.0;
constexpr double kMostCurves = 40.0;      // with a jerk limit
constexpr double kShortestSlope = 0.001;  // [s]

// [s] The time at which a path from planFeedRate() reaches the rate or its end.
double timeToRate(const Profile& path, double rate) {
  const double duration = path.duration().value();
  if (path.pieceCount() == 0) return duration;
  const Piece last = path.pieces().back();
  const bool there = rate > 0.0 && last.v0 == rate && last.a == 0.0 && last.j == 0.0;
  return there ? duration - last.duration.value() : duration;
}

}  // namespace

TrajectoryPath::TrajectoryPath(std::vector<Member> members, DoubleDouble origin,
                               std::shared_ptr<const PathMarks> marks)
    : members_(std::move(members)), origin_(origin), marks_(std::move(marks)) {
  endTogether();
}

// Taking up a backlash at the end may last longer than the trajectory.
void TrajectoryPath::endTogether() {
  DoubleDouble longest;
  for (const Member& member : members_) longest = std::max(longest, member.curve->duration());
  for (Member& member : members_) {
    const DoubleDouble left = longest - member.curve->duration();
    if (!(left.hi > 0.0)) continue;
    Sections sections;
    sections.add(Excerpt{member.curve, 0.0, member.curve->duration()});
    sections.add(Piece{left, member.curve->endPosition()});
    member.curve = std::make_shared<const Profile>(0, std::move(sections));
  }
}

Profile TrajectoryPath::plan(std::int64_t at_ns, const MotionState& from,
                             double speed_override) const {
  return onPath(slowDown(at_ns, onCurves(from), std::min(speed_override, 1.0), &Member::bounds));
}

Profile TrajectoryPath::planStop(std::int64_t at_ns, const MotionState& from) const {
  return onPath(slowDown(at_ns, onCurves(from), 0.0, &Member::stop_bounds));
}

Profile TrajectoryPath::slowDown(std::int64_t at_ns, const MotionState& from, double rate,
                                 Bounds bounds) const {
  Profile even = changeRate(at_ns, from, rate, bounds);
  const double time = timeToRate(even, rate);
  if (rate < from.velocity && time > kShortestSlope) {
    if (std::optional<Profile> steeper = brake(at_ns, from, rate, bounds, time)) {
      return *std::move(steeper);
    }
  }
  return even;
}

std::optional<Profile> TrajectoryPath::brake(std::int64_t at_ns, const MotionState& from,
                                             double rate, Bounds bounds, double sooner_than) const {
  const bool smooth = std::any_of(members_.begin(), members_.end(), [&](const Member& member) {
    return (member.*bounds).jerk > 0.0;
  });
  // The tolerance covers what the trajectory itself may exceed. With a jerk limit it is needed even
  // at a slightly lower rate.
  const double part = smooth ? 1.0 : 1.0 / (1.0 + kTrajectoryTolerance);
  std::vector<LimitedCurve> curves;
  curves.reserve(members_.size());
  for (const Member& member : members_) {
    const MotorBounds& given = member.*bounds;
    curves.push_back({member.curve, {part * given.acceleration, given.jerk}});
  }
  const DoubleDouble end = members_.front().curve->duration();
  const double slice = std::max(kShortestSlope, sooner_than / (smooth ? kMostCurves : kMostSlopes));
  const auto plan = smooth ? planJerkLimitedFeedDeceleration : planFeedDeceleration;
  return plan(at_ns, from, rate, curves, slice, sooner_than, end);
}

MotionState TrajectoryPath::restart(DoubleDouble position) const {
  const std::int64_t at_ns = splitNanoseconds(position - origin_).whole;
  const bool rests = std::all_of(members_.begin(), members_.end(), [&](const Member& member) {
    return member.curve->stateAt(at_ns).velocity == 0.0;
  });
  return {position, rests ? 1.0 : 0.0, 0.0};
}

Profile TrajectoryPath::onPath(const Profile& on_curves) const {
  return origin_.hi == 0.0 ? on_curves : scaled(on_curves, origin_, 1.0);
}

MotionState TrajectoryPath::onCurves(const MotionState& on_path) const {
  MotionState state = on_path;
  state.position = state.position - origin_;
  return state;
}

// The rate changes as fast as the limits of all axes allow. If they never leave room for that, the
// trajectory continues almost unchanged: it also ends at rest.
Profile TrajectoryPath::changeRate(std::int64_t at_ns, const MotionState& from, double rate,
                                   Bounds bounds) const {
  const DoubleDouble end = members_.front().curve->duration();
  if (from.velocity == rate && from.acceleration == 0.0) {
    return planFeedRate(at_ns, from, rate, {1.0, 1.0}, 0.0, end);
  }
  if (std::optional<Profile> fastest = fastestChange(at_ns, from, rate, bounds)) {
    return *std::move(fastest);
  }
  std::vector<Piece> pieces = rampDown(at_ns, from);
  MotionState level{from.position, from.velocity, 0.0};
  if (!pieces.empty()) {
    const Piece& last = pieces.back();
    level.position = last.positionAt(last.duration);
    level.velocity = last.velocityAt(last.duration).value();
  }
  std::optional<Profile> change = fastestChange(at_ns, level, rate, bounds);
  if (!change) {
    FeedRateLimits limits = steepest(level, 0.0, bounds);
    limits.slope *= kLastResort;
    limits.jerk *= kLastResort;
    change = planFeedRate(at_ns, level, rate, limits, 0.0, end);
  }
  for (const Piece& piece : change->pieces()) pieces.push_back(piece);
  if (pieces.empty()) return {at_ns, level.position};
  return {at_ns, std::move(pieces)};
}

// The change begins now or, if one of the axes is already at its limit, as soon as there is some
// room.
std::optional<Profile> TrajectoryPath::fastestChange(std::int64_t at_ns, const MotionState& from,
                                                     double rate, Bounds bounds) const {
  const DoubleDouble end = members_.front().curve->duration();
  const double left = (end - from.position).value();
  std::optional<Profile> best;
  double soonest = std::numeric_limits<double>::infinity();
  double delay = 0.0;
  do {
    FeedRateLimits limits = steepest(from, delay, bounds);
    for (int i = 0; i < kTries; ++i, limits.slope *= kGentler, limits.jerk *= kGentler) {
      Profile path = planFeedRate(at_ns, from, rate, limits, delay, end);
      const double time = timeToRate(path, rate);
      if (time >= soonest) break;
      if (!keeps(motion::part(path, 0.0, time), bounds)) continue;
      best = std::move(path);
      soonest = time;
      break;
    }
    delay = std::max(kFirstDelay, 2.0 * delay);
  } while (delay < soonest && delay * from.velocity < left && from.velocity > 0.0);
  return best;
}

// Ends the slope of a stop within the limits of stops, because the trajectory may have a lower jerk
// limit, which couldn't end it in time.
std::vector<Piece> TrajectoryPath::rampDown(std::int64_t at_ns, const MotionState& from) const {
  FeedRateLimits limits = steepest(from, 0.0, &Member::stop_bounds);
  if (from.acceleration == 0.0 || limits.jerk == 0.0) return {};
  const DoubleDouble end = members_.front().curve->duration();
  for (int i = 0; i < kTries; ++i, limits.jerk *= kGentler) {
    const double change = from.acceleration * std::abs(from.acceleration) / (2.0 * limits.jerk);
    const double rate = std::clamp(from.velocity + change, 0.0, 1.0);
    const Profile path = planFeedRate(at_ns, from, rate, limits, 0.0, end);
    const Profile ramp_down = motion::part(path, 0.0, timeToRate(path, rate));
    if (!keeps(ramp_down, &Member::stop_bounds)) continue;
    return {ramp_down.pieces().begin(), ramp_down.pieces().end()};
  }
  return {};
}

FeedRateLimits TrajectoryPath::steepest(const MotionState& from, double delay,
                                        Bounds bounds) const {
  const DoubleDouble place = from.position + DoubleDouble(delay * from.velocity);
  FeedRateLimits limits{kSteepestSlope, 0.0};
  for (std::size_t member = 0; member < members_.size(); ++member) {
    const auto state = members_[member].curve->stateAt(splitNanoseconds(place).whole);
    const double speed = std::abs(state.velocity);
    if ((members_[member].*bounds).jerk > 0.0) {
      const double jerk =
          speed > 0.0 ? 2.0 * (members_[member].*bounds).jerk / speed : kSteepestJerk;
      limits.jerk = std::min(limits.jerk > 0.0 ? limits.jerk : kSteepestJerk, jerk);
    }
    if (speed > 0.0)
      limits.slope = std::min(limits.slope, 2.0 * (members_[member].*bounds).acceleration / speed);
  }
  return limits;
}

bool TrajectoryPath::keeps(const Profile& path, Bounds bounds) const {
  for (std::size_t member = 0; member < members_.size(); ++member) {
    if (!staysWithin(*members_[member].curve, path, members_[member].*bounds)) return false;
  }
  return true;
}

Profile TrajectoryPath::profileOf(std::size_t member, const Profile& path) const {
  if (origin_.hi == 0.0) return composeAlong(members_[member].curve, path);
  return composeAlong(members_[member].curve, scaled(path, DoubleDouble() - origin_, 1.0));
}

}  // namespace stepdriver::motion
