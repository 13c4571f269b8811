#pragma once

#include <cstdio>
#include <string>

#include "stepdriver_core/axis/config.h"

namespace stepdriver::ros_node {

/// A number as messages show it: six digits, no trailing zeros.
inline std::string numberText(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", number);
  return text;
}

/// The axis's unit on every ROS interface.
inline const char* unitOf(axis::Kind kind) { return kind == axis::Kind::kLinear ? "m" : "rad"; }

}  // namespace stepdriver::ros_node
