#pragma once

#include <optional>
#include <string>

#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// What is beyond a limit only by the rounding of units, or of the bound in a message, isn't.
constexpr double kSlack = 1.0 + 1e-9;

/// What the motion of an axis is checked against. A member is empty where it isn't known because
/// something is wrong with it; then nothing is said about what depends on it.
struct MotionContext {
  std::optional<int> microsteps;
  std::optional<driver::Timing> timing;  ///< with the configuration's overrides
  std::string chip_title;
};

/// Reads the kind of the axis, its scale, speeds, accelerations and soft limits.
///
/// The unit of the keys tells the kind; in the configuration a unit is mm or a degree.
///
/// @return the kind; none where it can't be told, which is an issue.
std::optional<Kind> readMotion(ConfigReader& axis, const MotionContext& context,
                               AxisConfig& config);

}  // namespace stepdriver::config
