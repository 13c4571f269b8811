#pragma once

#include <optional>

#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// Reads `homing` and `require_homing`.
///
/// @param kind of the axis; empty: unknown, which has been reported, so nothing that depends on it
///   is reported.
/// @param config the endstops, speeds and soft limits for checking the homing.
void readHoming(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
