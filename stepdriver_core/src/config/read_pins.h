#pragma once

#include <string>
#include <utility>
#include <vector>

#include "config/config_reader.h"
#include "config/used_lines.h"

namespace stepdriver::config {

/// The word for a pull resistor.
std::string biasText(Bias bias);

/// All pins of a motor, with their keys in `pins`.
std::vector<std::pair<std::string, Pin>> pinsByKey(const MotorConfig& motor);

/// Reads `pins`, `fault_bias`, `fault_stop`, `in_position_...`, `invert` and `common_anode`.
///
/// @param chip nullptr if it isn't known; then nothing that depends on it is checked.
void readPins(ConfigReader& axis, const driver::DriverChip* chip, MotorConfig& config,
              UsedLines& used);

/// Reads `brake`.
///
/// @param pins_are_right false: the pins that it depends on have issues, and aren't checked again.
void readBrake(ConfigReader& axis, bool pins_are_right, AxisConfig& config, UsedLines& used);

/// Reads the switches of `endstops`.
///
/// @param is_only the axis has no other motor: readSharedEnds() reads the rest.
void readEndstops(ConfigReader& axis, bool is_only, MotorConfig& config, UsedLines& used);

}  // namespace stepdriver::config
