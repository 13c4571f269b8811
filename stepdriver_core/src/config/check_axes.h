#pragma once

#include <vector>

#include "config/used_lines.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// Like checkAxes() with one argument, without throwing.
///
/// @param issues every mistake is added here.
/// @param used the lines of the axes are added here, for others that name lines.
void checkAxes(const std::vector<AxisConfig>& axes, std::vector<ConfigIssue>& issues,
               UsedLines& used);

}  // namespace stepdriver::config
