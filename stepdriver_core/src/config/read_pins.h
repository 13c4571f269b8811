#pragma once

#include "config/used_lines.h"
#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// Reads `pins`, `fault_bias`, `invert` and `common_anode`.
///
/// @param chip nullptr if it isn't known; then nothing that depends on it is checked.
void readPins(ConfigReader& axis, const driver::DriverChip* chip, AxisConfig& config,
              UsedLines& used);

/// Reads `endstops`.
void readEndstops(ConfigReader& axis, AxisConfig& config, UsedLines& used);

}  // namespace stepdriver::config
