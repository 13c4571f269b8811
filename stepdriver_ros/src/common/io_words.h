#pragma once

#include <fmt/format.h>

#include <string>

namespace stepdriver::ros_node {

/// The state of an output with a name, as the console and /diagnostics show it: "off", "on" or, of
/// a PWM output that is on in part, "on at 0.25".
inline std::string outputWords(bool on, double value) {
  if (!on) return "off";
  const std::string rounded = fmt::format("{:.3g}", value);
  return rounded == "1" ? "on" : "on at " + rounded;
}

}  // namespace stepdriver::ros_node
