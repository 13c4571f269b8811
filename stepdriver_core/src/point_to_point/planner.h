#pragma once

#include <cstdint>
#include <optional>

#include "motion_limits.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// @file The planners take over from any state of an axis: at rest, moving either way, speeding up
///   or slowing down, faster than the limits or with more acceleration than they allow. The speed
///   never jumps, except by the start speed; the acceleration jumps if there is no jerk limit. A
///   speed above the maximum falls to it at the deceleration; an acceleration beyond its limit is
///   reduced at the jerk limit, and so is one that would take the speed beyond its limit or past
///   standstill.
///
/// A profile ends exactly on its target and continues from the state that it was planned from,
/// except that the velocity and acceleration of that state are rounded to doubles. The error is far
/// below a billionth of a microstep; just above a start speed, or over a ramp of millions of
/// microsteps, it may be larger: at most a thousandth.
///
/// From any speed up to the start speed, the motor can stop and start at once, in either direction
/// and at any acceleration. With a start speed a motion turns only on a whole microstep, at rest,
/// so that its steps before and after are about as far apart as at the start speed.
///
/// All planners throw motion::TooLong if the motion takes longer than Profile::kLongest. A plan
/// takes 0.5 to 2.5 us on a processor of 3 GHz.
/// @pre finite states; positions and targets of less than 2^53 microsteps.

/// A planned motion, and whether it overshoots its target.
struct Plan {
  Profile profile;
  /// How far the motion overshoots its target before it turns and comes back [microsteps]; 0 if it
  /// makes no step beyond it. Above 0 only if no motion within the limits could turn or stop before
  /// the target.
  double overshoot = 0.0;

  bool overshoots() const { return overshoot > 0.0; }
};

/// The fastest motion to rest on `target`, if it passes it by less than half a microstep: it makes
/// no step beyond it. Otherwise the fastest one that doesn't pass the target at all; if there is
/// none, the fastest of all.
Plan planMove(std::int64_t start_ns, const MotionState& from, std::int64_t target,
              const MotionLimits& limits);

/// The fastest change to a velocity, which then stays: for ever (95 years), or until the motion
/// must slow down to come to rest on `stand_at`. The limits' max_speed bounds the velocity.
///
/// @param velocity [microsteps/s] 0 stops.
/// @param stand_at lies ahead, in the direction of the velocity. If it is too near, or behind, the
///   motion turns and still ends there.
Plan planVelocity(std::int64_t start_ns, const MotionState& from, double velocity,
                  const MotionLimits& limits, std::optional<std::int64_t> stand_at = std::nullopt);

/// Slows down to rest on the first whole microstep that the deceleration and the jerk allow: the
/// motion keeps its speed for less than a microstep, and then decelerates at the limit. It speeds
/// up only from a crawl, slower than the speed that the axis reaches within a microstep.
///
/// @param not_beyond a position at which the motion would have come to rest anyway. It is ignored
///   if the stop doesn't head for it, unless the motion is passing it without a step.
Profile planStop(std::int64_t at_ns, const MotionState& state, const MotionLimits& limits,
                 std::optional<std::int64_t> not_beyond = std::nullopt);

}  // namespace stepdriver::motion
