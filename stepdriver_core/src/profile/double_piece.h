#pragma once

#include <algorithm>
#include <cmath>

#include "profile.h"

namespace stepdriver::motion {

/// A piece in doubles, which are precise enough to compare its motion with limits.
struct DoublePiece {
  double duration;  ///< [s]
  double p0;        ///< [microsteps]
  double v0;        ///< [microsteps/s]
  double a;         ///< [microsteps/s^2]
  double j;         ///< [microsteps/s^3]

  explicit DoublePiece(const Piece& piece)
      : duration(piece.duration.value()),
        p0(piece.p0.value()),
        v0(piece.v0),
        a(piece.a),
        j(piece.j) {}

  /// @name Values at t [s] from the beginning of the piece; way() is the distance from p0
  /// @{
  double displacement(double t) const { return t * (v0 + t * (a / 2.0 + t * (j / 6.0))); }
  double velocity(double t) const { return v0 + t * (a + t * (j / 2.0)); }
  double acceleration(double t) const { return a + t * j; }
  /// @}

  /// @name The largest absolute value between two times
  /// @{
  double highestSpeed(double from, double to) const {
    const double ends = std::max(std::abs(velocity(from)), std::abs(velocity(to)));
    const double level = j != 0.0 ? -a / j : from;
    return level > from && level < to ? std::max(ends, std::abs(velocity(level))) : ends;
  }
  double highestAcceleration(double from, double to) const {
    return std::max(std::abs(acceleration(from)), std::abs(acceleration(to)));
  }
  /// @}
};

}  // namespace stepdriver::motion
