#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace stepdriver::ros_node {

/// A number for messages: six digits, no trailing zeros. From 100000 on it is a whole number, which
/// is easier to read than 1.23457e+06, as far as a double counts exactly.
inline std::string roundedText(double number) {
  const double size = std::abs(number);
  char text[32];
  std::snprintf(text, sizeof text, size < 1e5 || size > 9e15 ? "%.6g" : "%.0f", number);
  return text;
}

/// The speed of a motor [rpm] at a step rate, rounded down to a tenth; "-" if its steps per
/// revolution are not known.
inline std::string rpmText(double rate, double steps_per_round) {
  if (steps_per_round <= 0.0) return "-";
  return roundedText(std::floor(600.0 * rate / steps_per_round) / 10.0);
}

/// A duration for messages [s]: to 0.01 s, and one digit of a shorter one.
inline std::string durationText(double seconds) {
  char text[32];
  if (std::abs(seconds) >= 0.01) return roundedText(std::round(seconds * 100.0) / 100.0);
  std::snprintf(text, sizeof text, "%.1g", seconds);
  return text;
}

}  // namespace stepdriver::ros_node
