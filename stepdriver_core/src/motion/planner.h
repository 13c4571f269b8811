#pragma once

#include <cstdint>
#include <optional>

#include "motion/limits.h"
#include "motion/profile.h"

namespace stepdriver::motion {

/// @file
/// The planners take over from whatever state an axis is in: at rest, moving either way, speeding
/// up or slowing down, faster than the limits or with more acceleration than they allow. The speed
/// never jumps, but by the start speed; the acceleration jumps where there is no jerk limit. A
/// speed above the maximum falls to it at the deceleration; an acceleration beyond its limit comes
/// back at the jerk, and so does one that would take the speed beyond its limit or past standstill.
///
/// A profile ends on its target exactly and goes on from the state that it was planned from, but
/// for the rounding of that state's velocity and acceleration to doubles. That is far below a
/// billionth of a microstep; just above a start speed, or over a ramp of millions of microsteps, it
/// may be more: at most a thousandth.
///
/// A speed up to the start speed is one to rest from and to start with, either way, whatever the
/// acceleration. With a start speed a motion turns round on a whole microstep only, at rest: so its
/// steps there and back are about as far apart as at the start speed.
///
/// All throw std::range_error where the motion takes longer than Profile::kLongest. A plan takes
/// some 20 us, and at most some 200 us, of a processor of 3 GHz.
/// @pre finite states; positions and targets of less than 2^53 microsteps.

/// A motion of a planner, and whether it keeps to its target.
struct Plan {
  Profile profile;
  /// How far the motion passes its target before it turns and comes back [microsteps]; 0 where it
  /// doesn't. Above 0 only where no motion within the limits could turn or rest before the target.
  double overshoot = 0.0;

  bool overshoots() const { return overshoot > 0.0; }
};

/// The fastest motion to rest on `target` that doesn't pass it, and where there is none, the
/// fastest of all.
Plan planMove(std::int64_t start_ns, const MotionState& from, std::int64_t target,
              const MotionLimits& limits);

/// The fastest change to a velocity, which then goes on: for ever (95 years), or until the motion
/// has to slow down to rest on `stand_at`. The limits' max_speed bounds the velocity.
///
/// @param velocity [microsteps/s] 0 stops.
/// @param stand_at lies ahead, in the direction of the velocity. Where it is too near, or behind,
///        the motion turns and ends there all the same.
Plan planVelocity(std::int64_t start_ns, const MotionState& from, double velocity,
                  const MotionLimits& limits, std::optional<std::int64_t> stand_at = std::nullopt);

/// Slows down to rest on the first whole microstep that the deceleration and the jerk allow: it
/// goes on as fast as it is for less than a microstep, and decelerates at the limit. It does not
/// speed up for it, but from a crawl slower than what the axis reaches within a microstep.
///
/// @param not_beyond a position ahead by which the motion would have come to rest anyway.
Profile planStop(std::int64_t at_ns, const MotionState& state, const MotionLimits& limits,
                 std::optional<std::int64_t> not_beyond = std::nullopt);

}  // namespace stepdriver::motion
