#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// Where each limit of an axis came from: `axis` (its configuration) or `joint` (the URDF).
struct LimitSources {
  const char* min_position = "axis";
  const char* max_position = "axis";
  const char* max_speed = "axis";
  bool limited_though_continuous = false;  ///< soft limits that the URDF says nothing of
};

/// Tightens the limits of the axes to those of their joints in a URDF.
///
/// @param urdf the XML of a robot description.
/// @param name full name of the parameter that it came from.
/// @param issues everything that is wrong with it, or doesn't fit the axes, is added here; then
///   the axes are not to be used.
/// @return the sources, in the order of the axes.
std::vector<LimitSources> applyRobotDescription(const std::string& urdf, const std::string& name,
                                                std::vector<config::AxisConfig>& axes,
                                                std::vector<ConfigIssue>& issues);

/// What is to be said of a continuous joint whose axis has soft limits.
std::string continuousJointText(const config::AxisConfig& axis);

/// A sentence with the limits of an axis that hold, and where each came from.
std::string limitsText(const config::AxisConfig& axis, const LimitSources& sources);

}  // namespace stepdriver::ros_node
