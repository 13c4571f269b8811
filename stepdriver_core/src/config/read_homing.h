#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::config {

/// A key of `homing` with a length: "pull_off_mm".
std::string homingKey(const char* what, Kind kind);

/// [unit] Where the axis stands when it has been homed.
double restOf(const HomingConfig& homing);

/// The kind as configurations name it: "limit".
const std::string& textOf(HomingKind kind);
/// The same of homing/check_at_flag.
const std::string& textOf(FlagCheck check);

/// Checks that the homings name inputs that are there.
///
/// @param name full name of the map of axes.
/// @param issues every mistake is added here.
void checkHomingInputs(const std::vector<AxisConfig>& axes, const std::vector<InputConfig>& inputs,
                       const std::string& name, std::vector<ConfigIssue>& issues);

/// Reads `homing` and `require_homing`.
///
/// @param kind of the axis; empty: unknown, which has been reported, so nothing that depends on it
///   is reported.
/// @param config the endstops, speeds and soft limits for checking the homing.
void readHoming(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
