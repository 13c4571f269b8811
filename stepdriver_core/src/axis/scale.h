#pragma once

#include "motor/motor.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::axis {

/// [microsteps/unit] in a microstep mode.
inline double stepsPerUnit(const config::AxisConfig& config, int microsteps) {
  return config.steps_per_unit * microsteps / config.microsteps;
}

}  // namespace stepdriver::axis
