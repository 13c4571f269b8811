#pragma once

namespace stepdriver::motion {

/// The limits of a motion. Finite numbers, all above 0 except start_speed and jerk, which may be 0.
///
/// The acceleration applies while the speed rises, the deceleration while it falls; both apply in
/// either direction.
struct MotionLimits {
  /// [microsteps/s] The speed at which the motor starts from rest, and from which it stops or slows
  /// down, without a ramp; it starts at max_speed at most. With a jerk limit the acceleration is 0
  /// at this jump: the ramps run between the start speed and the peak as they would between 0 and a
  /// peak.
  double start_speed = 0.0;
  double max_speed = 0.0;     ///< [microsteps/s]
  double acceleration = 0.0;  ///< [microsteps/s^2]
  double deceleration = 0.0;  ///< [microsteps/s^2]
  double jerk = 0.0;          ///< [microsteps/s^3] 0: no limit, the acceleration may jump
};

}  // namespace stepdriver::motion
