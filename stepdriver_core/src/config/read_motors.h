#pragma once

#include <optional>

#include "config/used_lines.h"
#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// Reads `motors`, or the pins and endstops of the only motor.
///
/// @param chip nullptr if it isn't known; then nothing that depends on it is checked.
void readMotors(ConfigReader& axis, const driver::DriverChip* chip, AxisConfig& config,
                UsedLines& used);

/// Reads what a homing needs to square several motors: `max_skew` and each motor's `offset`.
///
/// @pre readMotors() and readHoming()
/// @param kind empty if it isn't known, which has been reported.
void readSquaring(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
