#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// A relay or contactor that switches the power of all motors of a machine. It is switched on
/// before the first motor gets current, and off after an emergency stop, after a fault of its own,
/// and at the end.
struct MotorPowerConfig {
  std::string line;
  bool active_level = true;  ///< level of the line that switches the power on
  /// [ns] From that level until the power is there and the drivers have started.
  std::int64_t on_ns = 0;
  /// [ns] From the last pulse of an emergency stop until the power is switched off, at least: it
  /// also waits until each brake holds and each motor that must be disabled is.
  std::int64_t off_delay_ns = 0;
  /// A contact that is active while the power is there.
  std::optional<InputSwitch> feedback;
  /// [ns] How long the feedback may take to follow the line.
  std::int64_t feedback_timeout_ns = 1'000'000'000;
};

}  // namespace stepdriver::config
