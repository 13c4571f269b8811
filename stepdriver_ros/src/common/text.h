#pragma once

#include <cmath>
#include <cstdio>
#include <string>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::ros_node {

/// A number as messages show it: six digits, no trailing zeros; from 100000 on as a whole number,
/// as nobody reads 1.23457e+06, up to what a double counts exactly.
inline std::string roundedText(double number) {
  const double size = std::abs(number);
  char text[32];
  std::snprintf(text, sizeof text, size < 1e5 || size > 9e15 ? "%.6g" : "%.0f", number);
  return text;
}

/// The axis's unit on every ROS interface.
inline const char* unitOf(config::Kind kind) { return kind == config::Kind::kLinear ? "m" : "rad"; }

}  // namespace stepdriver::ros_node
