#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// Tightens the limits of the axes by the parameter `robot_description` of a namespace, or of one
/// above it. Asks the master.
///
/// @param issues every mistake is added here; the axes must then not be used.
/// @return warnings about it; empty: there is no such parameter.
std::optional<std::vector<std::string>> applyDescriptionParameter(
    const std::string& name_space, std::vector<config::AxisConfig>& axes,
    std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::ros_node
