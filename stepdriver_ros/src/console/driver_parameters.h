#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// The driver's parameters, read like the driver reads them.
struct DriverParameters {
  std::vector<config::AxisConfig> axes;
  double jog_timeout = 0.5;  ///< [s]
};

/// Asks the master, which can take a while.
///
/// @param driver full name of the node.
/// @throw ConfigError if the driver couldn't have started with them.
DriverParameters readDriverParameters(const std::string& driver);

/// Full names of all running drivers.
///
/// @return empty also if there is no master.
std::vector<std::string> runningDrivers();

}  // namespace stepdriver::console
