#pragma once

namespace stepdriver::config {

/// The lowest limits that an axis may have, whoever gives them. Far below any machine, and well
/// inside what the motion can count and time in 64 bits.
constexpr double kLowestRate = 1e-3;          ///< [steps/s]
constexpr double kLowestAcceleration = 1e-3;  ///< [steps/s^2]
constexpr double kLowestJerk = 1e-3;          ///< [steps/s^3]

}  // namespace stepdriver::config
