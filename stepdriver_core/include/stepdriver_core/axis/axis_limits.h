#pragma once

namespace stepdriver::axis {

/// What the motions of an axis keep to. A unit is m on a linear axis, rad on a rotary one.
struct AxisLimits {
  double max_speed = 0.0;     ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2]
  double deceleration = 0.0;  ///< [unit/s^2] of a stop it is AxisConfig's
  double jerk = 0.0;          ///< [unit/s^3] 0: none, the acceleration may jump
};

}  // namespace stepdriver::axis
