#pragma once

#include <array>
#include <cstddef>
#include <optional>

namespace stepdriver::axis {

/// Where the edges of the flag of a homing are: of each direction in which the axis passes, where
/// the flag becomes active, and where inactive. A flag has two sides, and a switch has hysteresis.
class FlagPlaces {
 public:
  /// [unit] @param direction 1 or -1
  std::optional<double>& at(int direction, bool active) {
    return places_.at((direction > 0 ? 2U : 0U) + (active ? 1U : 0U));
  }
  /// The positions of the axis have been declared anew.
  void shift(double by) {
    for (auto& place : places_) {
      if (place) *place += by;
    }
  }

 private:
  std::array<std::optional<double>, 4> places_;
};

}  // namespace stepdriver::axis
