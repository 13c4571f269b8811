#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"

namespace stepdriver::config {

/// Reads what an axis with one motor needs if both its ends share one line: `endstops/release_mm`,
/// or `release_deg`, and `endstops/assumed_end`.
///
/// @param kind empty if it isn't known; then nothing that depends on it is checked.
void readSharedEnds(ConfigReader& axis, const std::optional<Kind>& kind, AxisConfig& config);

/// Checks what several axes must have in common, or must not, if their switches share lines.
///
/// @param name full name of the map of axes.
void checkSharedSwitches(const std::vector<AxisConfig>& axes, const std::string& name,
                         std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::config
