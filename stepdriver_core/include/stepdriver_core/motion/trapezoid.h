#pragma once

#include <cstdint>

#include "stepdriver_core/motion/profile.h"

namespace stepdriver::motion {

/// Finite numbers; all above 0 but start_speed, which may be 0.
struct TrapezoidLimits {
  double start_speed;   ///< [microsteps/s] taken without a ramp; one above max_speed is cut to it
  double max_speed;     ///< [microsteps/s]
  double acceleration;  ///< [microsteps/s^2]
  double deceleration;  ///< [microsteps/s^2]
};

/// The fastest motion from rest to rest within the limits: up from the start speed, cruise at the
/// maximum, down to the start speed; a triangle where the way is too short for the maximum. Moves
/// of up to 2^40 steps, speeds down to 0.001 steps/s.
///
/// A triangle's peak is v^2 = v_start^2 + 2 s a d/(a + d), from v^2 - v_start^2 = 2 a s on each
/// side.
///
/// @throw std::range_error where it takes longer than Profile::kLongest.
Profile planTrapezoid(std::int64_t start_ns, std::int64_t from, std::int64_t to,
                      const TrapezoidLimits& limits);

/// Decelerates to rest from wherever the motion is at `at_ns`, on the first whole microstep that
/// the deceleration allows; at or below the start speed it rests at once.
///
/// @param not_beyond a position ahead by which the motion would have come to rest anyway.
Profile planStop(std::int64_t at_ns, const MotionState& state, const TrapezoidLimits& limits,
                 std::int64_t not_beyond);

}  // namespace stepdriver::motion
