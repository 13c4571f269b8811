#pragma once

#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// Checks axes that a program has made itself. readAxes() has checked those of a file already, and
/// in more detail: this makes sure that every number is one that motions can be planned with, and
/// that everything that an axis names is there. A machine::Machine and a setup::Hardware call it.
///
///     std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
///     config::checkAxes(axes);
///
/// @throw ConfigError with all issues, for example "x/deceleration: is 0, but must be from 1e-08 to
///   12500000 m/s^2".
void checkAxes(const std::vector<AxisConfig>& axes);

}  // namespace stepdriver::config
