#pragma once

#include <optional>
#include <string>

#include "config/config_reader.h"

namespace stepdriver::config {

/// The facts for checking the motion of an axis. A member is empty if it is wrong and therefore
/// unknown; nothing that depends on it is then reported.
struct MotionContext {
  std::optional<int> microsteps;
  /// The longest of its motors' drivers, with the configuration's overrides.
  std::optional<driver::Timing> timing;
  bool both_edges = false;   ///< each edge of STEP is a step
  std::string drivers_take;  ///< "the A4988 takes", for messages
  /// The key, below the axis, of the driver whose DIR must be held longest.
  std::string dir_hold_key;
};

/// Reads the kind of the axis, its scale, speeds, accelerations and soft limits.
///
/// The unit of the keys determines the kind; in the configuration a unit is mm or a degree.
///
/// @return the kind; empty if it can't be determined, which is an issue.
std::optional<Kind> readMotion(ConfigReader& axis, const MotionContext& context,
                               AxisConfig& config);

}  // namespace stepdriver::config
