#pragma once

#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// Reads when the motor has current, and what its absence means.
///
/// @param pins_are_right false: what depends on AxisConfig::pins isn't judged.
void readPower(ConfigReader& axis, bool pins_are_right, AxisConfig& config);

}  // namespace stepdriver::config
