#pragma once

#include <optional>

#include "motion_keys.h"
#include "stepdriver_core/config/config_reader.h"

namespace stepdriver::config {

/// A round of the motor, and the gear behind it. A member is empty where something is wrong with
/// it.
struct Rounds {
  std::optional<int> microsteps;
  std::optional<int> full_steps;  ///< or it isn't given
  std::optional<double> gear;     ///< rounds of the motor in one behind the gear: 1 by default
  double steps = 0.0;             ///< [microsteps/round]; 0: not known
};

Rounds readRounds(ConfigReader& axis, std::optional<int> microsteps);

/// Reads how many microsteps make a unit of the configuration: as such, or by the round of the
/// motor and what that travels.
///
/// @param presence kOptional: what is missing isn't to be reported.
/// @return [microsteps/unit]; none where something that it needs is missing or wrong.
std::optional<long double> readScale(ConfigReader& axis, const MotionKeys& keys,
                                     const Rounds& rounds, Presence presence);

}  // namespace stepdriver::config
