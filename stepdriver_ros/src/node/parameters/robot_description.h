#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// The source of each limit of an axis: `axis` (its configuration) or `joint` (the URDF).
struct LimitSources {
  const char* min_position = "axis";
  const char* max_position = "axis";
  const char* max_speed = "axis";
  bool limited_though_continuous = false;  ///< soft limits that the URDF doesn't contain
};

/// Tightens the limits of the axes to those of their joints in a URDF.
///
/// @param urdf the XML of a robot description.
/// @param name full name of its parameter.
/// @param issues every mistake in it, and every mismatch with the axes, is added here; the axes
///   must then not be used.
/// @return the sources, in the order of the axes.
std::vector<LimitSources> applyRobotDescription(const std::string& urdf, const std::string& name,
                                                std::vector<config::AxisConfig>& axes,
                                                std::vector<ConfigIssue>& issues);

/// The warning about a continuous joint whose axis has soft limits.
std::string continuousJointText(const config::AxisConfig& axis);

/// A sentence with the limits of an axis and their sources.
std::string limitsText(const config::AxisConfig& axis, const LimitSources& sources);

}  // namespace stepdriver::ros_node
