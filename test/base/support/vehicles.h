#pragma once

#include <utility>
#include <vector>

#include "kinematics.h"
#include "support/constants.h"

namespace stepdriver::base {

inline constexpr double kRightAngle = test::kPi / 2.0;

/// A wheel of the STM32 example: at most 1 m/s, 0.5 m/s^2, and 1.5 m/s^2 to slow down.
inline Wheel wheelAt(double y) {
  Wheel wheel;
  wheel.y = y;
  wheel.max_speed = 1.0;
  wheel.acceleration = 0.5;
  wheel.deceleration = 1.5;
  return wheel;
}

inline Wheel middleWheel() { return wheelAt(0.0); }

inline Wheel steeredWheel() {
  Wheel wheel = wheelAt(0.0);
  wheel.steered = true;
  return wheel;
}

/// Left and right.
inline Kinematics twoWheels(double separation) {
  return {{wheelAt(separation / 2.0), wheelAt(-separation / 2.0)}, {}};
}

/// Two on the left, then two on the right.
inline Kinematics fourWheels(double separation) {
  return {{wheelAt(separation / 2.0), wheelAt(separation / 2.0), wheelAt(-separation / 2.0),
           wheelAt(-separation / 2.0)},
          {}};
}

/// A wheelbase of 0.4 m, and a steering that turns by a quarter of a revolution.
inline Kinematics tricycle(std::vector<Wheel> wheels) {
  return {std::move(wheels), Steering{0.4, 1.5707963267948966}};
}

}  // namespace stepdriver::base
