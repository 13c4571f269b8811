#pragma once

#include <optional>
#include <string>

#include "config/config_reader.h"

namespace stepdriver::config {

/// A key of `homing` with a length: "pull_off_mm".
std::string homingKey(const char* what, Kind kind);

/// [unit] Where the axis stands when it has been homed.
double restOf(const HomingConfig& homing);

/// Reads `homing` and `require_homing`.
///
/// @param kind of the axis; empty: unknown, which has been reported, so nothing that depends on it
///   is reported.
/// @param config the endstops, speeds and soft limits for checking the homing.
void readHoming(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
