#pragma once

#include <string>

namespace stepdriver::ros_node {

/// @name The state of an axis in words
///
/// The node publishes them in AxisStates, so that the panel shows the same as the console.
///
/// @tparam Axis has `powered`, `enabled`, `idle`, `asleep`, `fault`, `held`, `moving`, `homed` and
///   `position_valid`
/// @{
template <typename Axis>
std::string motorWords(const Axis& axis) {
  if (!axis.powered) return "no power";
  if (axis.enabled) return "on";
  if (axis.idle) return "idle";
  return axis.asleep ? "asleep" : "off";
}

template <typename Axis>
std::string stateWords(const Axis& axis) {
  if (!axis.fault.empty()) return "FAULT";
  const std::string motion = axis.held ? "HELD" : axis.moving ? "moving" : "rest";
  if (axis.homed) return motion + " homed";
  return axis.position_valid ? motion : motion + " unverified";
}
/// @}

}  // namespace stepdriver::ros_node
