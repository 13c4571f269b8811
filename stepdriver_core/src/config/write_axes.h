#pragma once

#include <vector>

#include "read_chip.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"

namespace stepdriver::config {

/// Axes as the map `axes` of a configuration file, for readAxes().
struct WrittenAxes {
  ConfigValue::Map axes;
  OwnChips chips;  ///< the drivers, by the names that they have in `axes`
};

/// @pre The names of the axes differ, and so do those of the motors of each axis.
WrittenAxes writeAxes(const std::vector<AxisConfig>& axes);

/// The map of a switch in a configuration file.
ConfigValue::Map writeSwitch(const InputSwitch& input);

/// The list of a matrix in a configuration file.
ConfigValue::List writeMatrix(const Matrix& matrix);

}  // namespace stepdriver::config
