#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "config/used_lines.h"
#include "read_chip.h"
#include "read_tmc.h"

namespace stepdriver::config {

/// The driver of a motor.
struct MotorChip {
  /// Empty if it isn't known, which has been reported; then nothing that depends on it is checked.
  std::optional<driver::DriverChip> chip;
  /// The prefix of its `driver`, `chip` and `timing` in the keys of the axis: "motors/left/", or
  /// empty if they are the axis's.
  std::string key;
  std::optional<TmcConfig> tmc;  ///< of this motor's chip
};

/// Reads the drivers of the motors of an axis: of each its own, or that of the axis.
///
/// @return one for each of `motors`, in their order; one if there is no such map.
std::vector<MotorChip> readMotorChips(ConfigReader& axis, const OwnChips& own, UsedPorts& ports);

/// The key of a motor's MotorConfig::offset.
const char* offsetKey(Kind kind);

/// Reads `motors`, or the pins and endstops of the only motor.
///
/// @param chips of readMotorChips().
void readMotors(ConfigReader& axis, const std::vector<MotorChip>& chips, AxisConfig& config,
                UsedLines& used);

/// Reads the speeds in each motor's `tmc`. @pre readMotors() and readMotion()
void readSpeedsOfChips(ConfigReader& axis, AxisConfig& config);

/// Reads what a homing needs to square several motors: `max_skew` and each motor's `offset`.
///
/// @pre readMotors() and readHoming()
/// @param kind empty if it isn't known, which has been reported.
void readSquaring(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
