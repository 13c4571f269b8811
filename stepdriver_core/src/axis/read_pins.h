#pragma once

#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/axis/config_reader.h"

namespace stepdriver::axis {

/// The lines of the whole configuration: each may serve one purpose only.
class UsedLines {
 public:
  explicit UsedLines(std::vector<ConfigIssue>& issues) : issues_(issues) {}

  /// @param key full name of the parameter that names the line.
  void add(const std::string& key, const std::string& line);

 private:
  std::vector<ConfigIssue>& issues_;
  std::map<std::string, std::string> users_;  ///< line -> key
};

/// Reads `pins`, `fault_bias`, `invert` and `common_anode`.
///
/// @param chip nullptr where it isn't known; then what depends on it is let pass.
void readPins(ConfigReader& axis, const chip::Chip* chip, AxisConfig& config, UsedLines& used);

/// Reads `endstops`.
void readEndstops(ConfigReader& axis, AxisConfig& config, UsedLines& used);

}  // namespace stepdriver::axis
