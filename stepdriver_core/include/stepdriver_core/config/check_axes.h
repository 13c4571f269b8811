#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// Checks axes that a program has made itself, by the rules of a configuration file: readAxes() has
/// checked those of a file already. A machine::Machine and a setup::Hardware call it. Messages name
/// the keys and the units of a file.
///
///     std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
///     config::checkAxes(axes);
///
/// @throw ConfigError with all issues, for example "axes/x/deceleration_mm_s2: is 0.0, but must be
///   above 0".
void checkAxes(const std::vector<AxisConfig>& axes);

/// What is allowed, but may not be meant, of the order in which axes are homed: an axis with a
/// brake, which may carry a load, is homed together with others, whose way it may be in.
///
/// @return a sentence for each such axis.
std::vector<std::string> homingWarnings(const std::vector<AxisConfig>& axes);

}  // namespace stepdriver::config
