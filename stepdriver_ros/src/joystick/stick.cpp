#include "stick.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::joystick {

double velocityOf(const Stick& stick, double deflection) {
  // Deflections are floats: 0.1 as a float is beyond a dead band of 0.1 as a double.
  const double dead_band = static_cast<float>(stick.dead_band);
  const double out = std::min(std::abs(deflection), 1.0) - dead_band;
  if (!(out > 0.0)) return 0.0;
  const double speed = stick.max_speed * std::pow(out / (1.0 - dead_band), stick.exponent);
  return (deflection < 0.0) != stick.inverted ? -speed : speed;
}

}  // namespace stepdriver::joystick
