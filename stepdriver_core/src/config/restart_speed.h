#pragma once

#include <algorithm>
#include <cmath>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// The speed that the motor takes and leaves without a ramp [unit/s]: the start speed, but at least
/// what a ramp from rest has after its first full step.
inline double restartSpeed(const AxisConfig& config) {
  const double full_step = config.microsteps / config.steps_per_unit;
  return std::max(config.start_speed,
                  std::sqrt(2.0 * std::min(config.acceleration, config.deceleration) * full_step));
}

}  // namespace stepdriver::config
