#pragma once

namespace stepdriver::joystick {

/// How the deflection of a stick becomes a velocity.
struct Stick {
  double max_speed = 0.0;  ///< [m/s|rad/s] at full deflection
  /// Fraction of the full deflection, from 0 to below 1: no speed up to here.
  double dead_band = 0.1;
  double exponent = 1.0;  ///< above 1: finer near the dead band
  bool inverted = false;
};

/// @param deflection from -1 to 1; anything beyond counts as full.
/// @return the velocity [m/s|rad/s]: 0 in the dead band, rising from 0 without a jump beyond it.
double velocityOf(const Stick& stick, double deflection);

}  // namespace stepdriver::joystick
