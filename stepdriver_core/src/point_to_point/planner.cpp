#include "planner.h"

#include <algorithm>
#include <cmath>

#include "end_state.h"
#include "motion_builder.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

// Passing a target by less than this makes no step beyond it: the next one comes at a half. The
// rest is for rounding, see Stop.
constexpr double kHarmless = 0.49;  // microsteps

// How far a profile goes beyond its target, as seen from its beginning.
double farthestBeyond(const Profile& profile, const MotionState& from, DoubleDouble target) {
  const double displacement = (target - from.position).hi;
  double farthest = 0.0;
  const auto consider = [&](DoubleDouble position) {
    const double beyond = (position - target).hi;
    farthest = std::max(farthest, displacement == 0.0 ? std::abs(beyond)
                                                      : std::copysign(1.0, displacement) * beyond);
  };
  for (const Piece& piece : profile.pieces()) {
    consider(piece.p0);
    const double end = piece.duration.hi;
    for (double t = piece.firstTurn(0.0); t < end; t = piece.firstTurn(t)) {
      consider(piece.positionAt(t));
    }
  }
  return farthest;
}

// The speed of a move of one microstep without a jerk limit, up from 0 and down again:
// 1 = v^2/(2 a) + v^2/(2 d).
double speedWithinMicrostep(const MotionLimits& limits) {
  const double a = limits.acceleration;
  const double d = limits.deceleration;
  return std::sqrt(2.0 * a * (d / (a + d)));
}

// The limits of a stop: the current speed is the maximum, but at least a crawl.
MotionLimits stopping(const MotionBuilder& motion, const MotionLimits& limits) {
  const double level =
      std::abs(levelVelocity(EndState<DoubleDouble>(motion.v(), motion.a()), limits).value());
  const double crawl = std::max(speedWithinMicrostep(limits), limits.start_speed);
  MotionLimits slower = limits;
  slower.max_speed = std::min(limits.max_speed, std::max(level, crawl));
  return slower;
}

// Whether it first comes to rest: with a start speed, a motion in the wrong direction does.
bool turnsAtRest(const MotionBuilder& motion, double sign, const MotionLimits& limits) {
  return limits.start_speed > 0.0 && sign * motion.v().hi < 0.0;
}

// The fastest motion to rest on the target, which it may overshoot.
Plan fastestMove(std::int64_t start_ns, const MotionState& from, std::int64_t target,
                 const MotionLimits& limits) {
  const DoubleDouble end = fromInteger(target);
  MotionBuilder motion(from, limits);
  const Stop stop(motion.v(), motion.a(), limits);
  const double beyond = (end - motion.position() - stop.length()).hi;
  if (turnsAtRest(motion, beyond, limits) && !stop.meets(beyond)) {
    motion.moveTo(motion.nextRest(limits), stopping(motion, limits));
    motion.moveTo(target, limits);
  } else {
    motion.moveTo(target, stop, limits);
  }
  Plan plan{motion.profile(start_ns)};
  const double farthest = farthestBeyond(plan.profile, from, end);
  if (farthest > kHarmless) plan.overshoot = farthest;
  return plan;
}

}  // namespace

Plan planMove(std::int64_t start_ns, const MotionState& from, std::int64_t target,
              const MotionLimits& limits) {
  Plan fastest = fastestMove(start_ns, from, target, limits);
  const double displacement = (fromInteger(target) - from.position).hi;
  const bool may_turn = limits.jerk > 0.0 && limits.start_speed == 0.0 && displacement != 0.0;
  if (!fastest.overshoots() || !may_turn) return fastest;
  // The fastest motion reduces its deceleration before it turns. Without that it may turn in time.
  MotionBuilder motion(from, limits);
  if (!motion.turnAt(target, displacement > 0.0 ? -1.0 : 1.0, limits)) return fastest;
  motion.moveTo(target, limits);
  return {motion.profile(start_ns)};
}

Plan planVelocity(std::int64_t start_ns, const MotionState& from, double velocity,
                  const MotionLimits& limits, std::optional<std::int64_t> stand_at) {
  if (velocity == 0.0) return {planStop(start_ns, from, limits, stand_at)};
  MotionLimits bounded = limits;
  bounded.max_speed = std::min(limits.max_speed, std::abs(velocity));
  if (stand_at) return planMove(start_ns, from, *stand_at, bounded);
  const double sign = std::copysign(1.0, velocity);
  MotionBuilder motion(from, bounded);
  if (turnsAtRest(motion, sign, bounded)) {
    motion.moveTo(motion.nextRest(bounded), stopping(motion, bounded));
  }
  motion.moveOn(sign, bounded);
  return {motion.profile(start_ns)};
}

Profile planStop(std::int64_t at_ns, const MotionState& state, const MotionLimits& limits,
                 std::optional<std::int64_t> not_beyond) {
  const MotionBuilder motion(state, limits);
  const MotionLimits slower = stopping(motion, limits);
  const std::int64_t rest = motion.nextRest(limits);
  const double heading = motion.heading(limits);
  if (not_beyond && heading * static_cast<double>(rest - *not_beyond) > 0.0) {
    // A motion that still decelerates hard may turn before it rests, and then leaves what is ahead.
    const DoubleDouble past = motion.position() - fromInteger(*not_beyond);
    const bool ahead = heading * past.hi <= 0.0;
    const DoubleDouble end = past + Stop(motion.v(), motion.a(), limits).length();
    if (ahead || heading * end.hi < kHarmless) {
      return planMove(at_ns, state, *not_beyond, slower).profile;
    }
  }
  return fastestMove(at_ns, state, rest, slower).profile;
}

}  // namespace stepdriver::motion
