#pragma once

#include "stepdriver_core/config/axis_config.h"

/// What numbers of an axis may be, in steps, from any source. The highest are far beyond any
/// machine, and well within what the motion can count and time in 64 bits.
namespace stepdriver::config {

/// Tolerance for limits: the rounding of units, or of the bound in a message, doesn't count as
/// exceeding a limit.
constexpr double kSlack = 1.0 + 1e-9;

constexpr double kLowestScale = 1e-9;  ///< [steps/unit of configurations]
constexpr double kHighestScale = 1e9;
constexpr double kHighestAcceleration = 1e12;        ///< [steps/s^2]
constexpr double kHighestJerk = 1e15;                ///< [steps/s^3]
constexpr double kMostBacklash = 1e6;                ///< [steps]
constexpr double kFarthestTravel = 1099511627776.0;  ///< [steps] 2^40, of any move
constexpr double kLongestTime = 86'400.0;            ///< [s] a timeout
/// From a crane to a tool: the parts of a motion are a second to half a millisecond apart.
constexpr double kLowestShaperFrequency = 0.5;      ///< [Hz]
constexpr double kHighestShaperFrequency = 1000.0;  ///< [Hz]
constexpr double kMostShaperDamping = 0.9;

}  // namespace stepdriver::config
