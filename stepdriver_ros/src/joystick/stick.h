#pragma once

namespace stepdriver::joystick {

/// How the deflection of a stick becomes a velocity.
struct Stick {
  double max_speed = 0.0;  ///< [m/s|rad/s] at full deflection
  double dead_band = 0.1;  ///< of the full deflection, from 0 to below 1: no speed up to here
  double exponent = 1.0;   ///< above 1: finer near the dead band
  bool inverted = false;
};

/// @param deflection from -1 to 1; what is beyond counts as full.
/// @return the velocity [m/s|rad/s]: 0 in the dead band, and beyond it from 0 on, without a jump.
double velocityOf(const Stick& stick, double deflection);

}  // namespace stepdriver::joystick
