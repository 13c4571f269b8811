#include "setpoint_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "point_motion.h"
#include "point_to_point/moving_target.h"
#include "profile/position_range.h"
#include "profile/resting_count.h"

namespace stepdriver::activity {
namespace {

// A faster stream is followed as if it had this part of the highest speed: the rest is for catching
// up with it.
constexpr double kFastestPoint = 0.98;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

motion::Profile profileOf(std::int64_t at, const motion::MotionState& from,
                          std::vector<motion::Piece> pieces) {
  if (pieces.empty()) return {at, from.position};
  return {at, std::move(pieces)};
}

void append(std::vector<motion::Piece>& pieces, const motion::Profile& more) {
  for (const motion::Piece& piece : more.pieces()) pieces.push_back(piece);
}

// @param between see motion::planBetween().
bool isWithinSoftLimits(const axis::AxisModel& axis, const motion::Profile& profile,
                        double between) {
  const motion::PositionRange extent = motion::positionRangeOf(profile);
  const auto& lowest = axis.config.min_position;
  const auto& highest = axis.config.max_position;
  const double slack = static_cast<double>(axis.backlash()) - between;
  return (!lowest || extent.lowest >= axis.countOf(*lowest) - between - motion::kNoStep) &&
         (!highest || extent.highest <= axis.countOf(*highest) + slack + motion::kNoStep);
}

// The motor's target for coming to rest on the position after it was passed, or before it is
// reached.
// @param taken_up [microsteps] of the backlash, in this state
std::int64_t returnTarget(const axis::AxisModel& axis, const Goal& goal,
                          const motion::MotionState& from, std::int64_t taken_up,
                          const motion::MotionLimits& within) {
  if (axis.backlash() == 0) return *goal.target;
  const std::int64_t rest =
      motion::restingCount(motion::planStop(0, from, within).endPosition().value()) - taken_up;
  if (rest == *goal.target) return *goal.target + taken_up;
  return rest < *goal.target ? *goal.target + axis.backlash() : *goal.target;
}

motion::Profile positionProfile(const axis::AxisModel& axis, const Goal& goal,
                                const motion::MotionState& from, double slack, std::int64_t at,
                                const motion::MotionLimits& within) {
  const Setpoint& wanted = goal.setpoint;
  const double fastest = kFastestPoint * within.max_speed;
  const double velocity = std::clamp(wanted.velocity, -fastest, fastest);
  const std::int64_t target = velocity == 0.0  ? motorTarget(axis, goal, from, slack, within)
                              : velocity > 0.0 ? *goal.target + axis.backlash()
                                               : *goal.target;
  if (velocity == 0.0) return motion::planMove(at, from, target, within).profile;
  const std::int64_t taken_up = target - *goal.target;
  const motion::MovingTarget point{
      motion::DoubleDouble(wanted.position - goal.between(axis) + static_cast<double>(taken_up)) +
          velocity * seconds(at - wanted.reach_ns),
      velocity};
  std::vector<motion::Piece> pieces = motion::planIntercept(from, point, within, wanted.period);
  // If it hasn't caught up with the point by then, it returns all the same: the stream may have
  // ended.
  motion::DoubleDouble left = seconds(wanted.return_ns - at);
  pieces = motion::firstPart(std::move(pieces), left);
  for (const motion::Piece& piece : pieces) left = left - piece.duration;
  const motion::MotionState joined = motion::endOf(pieces, from);
  if (left.hi > 0.0) {
    motion::Piece keeping_up;
    keeping_up.duration = left;
    keeping_up.p0 = joined.position;
    keeping_up.v0 = joined.velocity;
    pieces.push_back(keeping_up);
  }
  const motion::MotionState last = motion::endOf(pieces, from);
  const std::int64_t rest = returnTarget(axis, goal, last, taken_up, within);
  append(pieces, motion::planMove(0, last, rest, within).profile);
  motion::Profile profile = profileOf(at, from, std::move(pieces));
  if (isWithinSoftLimits(axis, profile, goal.between(axis))) return profile;
  return motion::planMove(at, from, motorTarget(axis, goal, from, slack, within), within).profile;
}

motion::Profile velocityProfile(const axis::AxisModel& axis, const Goal& goal,
                                const motion::MotionState& from, std::int64_t at,
                                const motion::MotionLimits& within) {
  if (goal.velocity != 0.0) {
    const double velocity = std::copysign(within.max_speed, goal.velocity);
    return motion::planVelocity(at, from, velocity, within, standAt(axis, goal, from, within))
        .profile;
  }
  return motion::planStop(at, from, within, limitAhead(axis, from, within));
}

// Slows down when the timeout is over.
motion::Profile untilTimeout(const axis::AxisModel& axis, const Goal& goal,
                             const motion::MotionState& from, const motion::Profile& profile) {
  const std::int64_t until = goal.setpoint.until_ns;
  if (profile.endNs() <= until) return profile;
  std::vector<motion::Piece> pieces;
  append(pieces, profile);
  pieces = motion::firstPart(std::move(pieces), seconds(until - profile.startNs()));
  std::optional<std::int64_t> not_beyond;
  if (goal.target && motion::overshootOf(profile) == 0.0) {
    not_beyond = motion::restingCount(profile.endPosition().value());
  }
  append(pieces,
         motion::planStop(until, motion::endOf(pieces, from), axis.stopLimits(), not_beyond));
  return profileOf(profile.startNs(), from, std::move(pieces));
}

}  // namespace

motion::Plan planSetpoint(const axis::AxisModel& axis, const Goal& goal,
                          const motion::MotionState& from, double slack, std::int64_t at,
                          const motion::MotionLimits& within) {
  const Setpoint& wanted = goal.setpoint;
  if (at >= wanted.until_ns) return {motion::planStop(at, from, axis.stopLimits())};
  const motion::Profile profile = wanted.of_position
                                      ? positionProfile(axis, goal, from, slack, at, within)
                                      : velocityProfile(axis, goal, from, at, within);
  motion::Plan plan{untilTimeout(axis, goal, from, profile)};
  plan.overshoot = motion::overshootOf(plan.profile);
  return plan;
}

}  // namespace stepdriver::activity
