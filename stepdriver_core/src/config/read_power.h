#pragma once

#include <string>

#include "config/config_reader.h"

namespace stepdriver::config {

/// As in files: "disable".
std::string textOf(IdleAction action);

/// Reads when the motor has current, and what happens without it.
///
/// @param pins_are_right false: nothing that depends on AxisConfig::pins is checked.
void readPower(ConfigReader& axis, bool pins_are_right, AxisConfig& config);

}  // namespace stepdriver::config
