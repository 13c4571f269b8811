#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace stepdriver::motion {

/// What the axes allow along a straight line, all above 0 and finite.
struct LineLimits {
  double speed = 0.0;         ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2] while the speed rises
  double deceleration = 0.0;  ///< [unit/s^2] while the speed falls
  double jerk = 0.0;          ///< [unit/s^3]
};

/// A part of a motion along a line, with constant jerk.
struct LinePhase {
  double duration = 0.0;  ///< [s]
  double jerk = 0.0;      ///< [unit/s^3]
};

/// The fastest motion along a line [unit] from one speed [unit/s] to another one, without an
/// acceleration at either end: the fastest changes of velocity (see changeVelocity()) to the
/// highest peak for which the line is long enough, and from it.
///
/// @return empty if the line is too short for the change of the speed, or if a speed is too high.
std::optional<std::vector<LinePhase>> planLine(double length, double begin_speed, double end_speed,
                                               const LineLimits& limits);

}  // namespace stepdriver::motion
