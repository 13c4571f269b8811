#pragma once

namespace stepdriver::motion {

/// What a motion keeps to. Finite numbers, all above 0 but start_speed and jerk, which may be 0.
///
/// The deceleration holds where the speed falls, the acceleration where it rises; both hold in
/// either direction.
struct MotionLimits {
  /// [microsteps/s] The speed that the motor takes up from rest, and gives up to rest, without a
  /// ramp. One above max_speed is cut to it. With a jerk limit the acceleration is 0 at this jump:
  /// the ramps run between the start speed and the peak as they would between 0 and a peak.
  double start_speed = 0.0;
  double max_speed = 0.0;     ///< [microsteps/s]
  double acceleration = 0.0;  ///< [microsteps/s^2]
  double deceleration = 0.0;  ///< [microsteps/s^2]
  double jerk = 0.0;          ///< [microsteps/s^3] 0: none, the acceleration may jump
};

}  // namespace stepdriver::motion
