#pragma once

#include <cmath>
#include <limits>

namespace stepdriver::motion {

/// [microsteps] By how much a calculation in doubles may change a place.
inline double roundingOf(double count) {
  return 4.0 * std::numeric_limits<double>::epsilon() * std::abs(count);
}

/// [microsteps] The whole count, if only rounding keeps a place from it. Otherwise an axis that
/// stands still far from 0 would be moved by that rounding, and in the short time between two
/// waypoints of the other axes that takes more than its acceleration.
inline double withoutRounding(double count) {
  const double whole = std::nearbyint(count);
  return std::abs(whole - count) <= roundingOf(count) ? whole : count;
}

}  // namespace stepdriver::motion
