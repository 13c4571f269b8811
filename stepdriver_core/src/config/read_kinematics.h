#pragma once

#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// Reads which axes share motors, and how, into these axes.
///
/// @code{.yaml}
/// kinematics:
///   type: corexy                # or h_bot or differential; or `matrix` instead
///   matrix: [[1, 1], [1, -1]]   # by motor: its way for a unit of each axis
///   axes: [x, y]                # 2 to 4; the first motor has the pins of the first axis, and so
///   on
/// @endcode
///
/// @param reader of that map.
/// @param axes_are_right the axes can be compared with it.
void readKinematics(ConfigReader reader, bool axes_are_right, std::vector<AxisConfig>& axes);

}  // namespace stepdriver::config
