#pragma once

#include <map>
#include <optional>
#include <string>

#include "config/config_reader.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// The chips on the serial ports of a configuration.
class UsedPorts {
 public:
  /// Reports a second chip at an address, and another rate on the same port.
  /// @param tmc the map of the chip.
  void add(ConfigReader& tmc, const TmcConfig& chip);

 private:
  struct Port {
    int baud = 0;
    std::string key;                   // names the map that gave the rate
    std::map<int, std::string> chips;  // the keys of their maps, by address
  };
  std::map<std::string, Port> ports_;
};

/// Reads `tmc` of a motor, or of an axis with one: its chip is configured over its UART. The
/// microsteps of such a chip are those of its registers.
///
/// @param chip of readChip(); empty if it isn't known, which has been reported.
/// @return empty if there is no such map, or if it has issues.
std::optional<TmcConfig> readTmc(ConfigReader& motor, std::optional<driver::DriverChip>& chip,
                                 UsedPorts& used);

/// Reads the speeds in it, which need the scale of the axis.
/// @param motor as for readTmc(). @pre readMotion()
void readTmcSpeeds(ConfigReader& motor, const AxisConfig& axis, const driver::DriverChip& chip,
                   TmcConfig& tmc);

/// The map `tmc` as a file would have it.
ConfigValue::Map writeTmc(const TmcConfig& tmc, const AxisConfig& axis);

}  // namespace stepdriver::config
