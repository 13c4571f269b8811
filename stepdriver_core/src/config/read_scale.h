#pragma once

#include <optional>

#include "config/config_reader.h"
#include "motion_keys.h"

namespace stepdriver::config {

/// A revolution of the motor, and the gear behind it. A member is empty if its value is wrong.
struct Rounds {
  std::optional<int> microsteps;
  std::optional<int> full_steps;  ///< empty if it isn't given, too
  /// Motor revolutions per revolution of the gear's output: 1 by default.
  std::optional<double> gear;
  double steps = 0.0;  ///< [microsteps per revolution]; 0: not known
};

Rounds readRounds(ConfigReader& axis, std::optional<int> microsteps);

/// Reads the number of microsteps per unit of the configuration: directly, or from the steps and
/// the travel of a motor revolution.
///
/// @param presence kOptional: a missing key isn't reported.
/// @return [microsteps/unit]; empty if a key that it needs is missing or wrong.
std::optional<long double> readScale(ConfigReader& axis, const MotionKeys& keys,
                                     const Rounds& rounds, Presence presence);

}  // namespace stepdriver::config
