#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// Tightens the limits of the axes to those of their joints in a URDF.
///
/// @param urdf the XML of a robot description. It is refused if mistakeInXml() finds one.
/// @param name full name of its parameter.
/// @param issues every mistake in it, and every mismatch with the axes, is added here; the axes
///   must then not be used.
/// @return warnings about continuous joints whose axes have soft limits.
std::vector<std::string> applyRobotDescription(const std::string& urdf, const std::string& name,
                                               std::vector<config::AxisConfig>& axes,
                                               std::vector<ConfigIssue>& issues);

/// A sentence with the limits of an axis and their sources.
std::string limitsText(const config::AxisConfig& axis);

}  // namespace stepdriver::ros_node
