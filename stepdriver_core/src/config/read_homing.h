#pragma once

#include <optional>

#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// Reads `homing` and `require_homing`.
///
/// @param kind of the axis; none: it isn't known, which has been reported, and nothing is said
/// about
///   what depends on it.
/// @param config has the endstops, speeds and soft limits that the homing is checked against.
void readHoming(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
