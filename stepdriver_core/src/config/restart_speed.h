#pragma once

#include <algorithm>
#include <cmath>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// The speed at which the motor starts and stops without a ramp [unit/s]: the start speed, but at
/// least the speed that a ramp from rest reaches after its first full step.
inline double restartSpeed(const AxisConfig& config) {
  const double full_step = config.microsteps / config.steps_per_unit;
  return std::max(config.start_speed,
                  std::sqrt(2.0 * std::min(config.acceleration, config.deceleration) * full_step));
}

}  // namespace stepdriver::config
