#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// The driver's parameters, as it reads them itself.
struct DriverParameters {
  std::vector<config::AxisConfig> axes;
  double jog_timeout = 0.5;  ///< [s]
};

/// Asks the master, which may take a while.
///
/// @param driver full name of the node.
/// @throw ConfigError where the driver couldn't have started with them.
DriverParameters readDriverParameters(const std::string& driver);

/// Full names of all drivers that there are.
///
/// @return none where there is no master, too.
std::vector<std::string> runningDrivers();

}  // namespace stepdriver::console
