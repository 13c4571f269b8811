#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "config/read_chip.h"
#include "config/used_lines.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// Like readAxes() without `used`.
///
/// @param used the lines of the axes are added here, for other keys that name lines.
/// @param own drivers that a program has made itself.
std::vector<AxisConfig> readAxes(const ConfigValue& axes, const std::string& name,
                                 std::vector<ConfigIssue>& issues, UsedLines& used,
                                 const OwnChips& own = {});

/// Whether something of a machine can have this name, which becomes part of ROS names.
bool isName(const std::string& name);

/// @return the required name of a line; empty if there is an issue.
std::string readRequiredLine(ConfigReader& reader, const std::string& key, UsedLines& used);

/// Reads `pin: "gpiochip0:25"`, `active_level: high` and `bias: as_is` from a map; bias is
/// optional.
InputSwitch readInputSwitch(ConfigReader& reader, UsedLines& used);

}  // namespace stepdriver::config
