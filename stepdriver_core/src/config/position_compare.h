#pragma once

#include <string>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/io_config.h"

namespace stepdriver::config {

/// Why the position of an axis can't switch an output so, as the end of a sentence that begins with
/// the output; empty if it can. Places must be within the soft limits, and what the top speed of
/// the axis makes of them must be within what the output can do.
std::string whyNotCompared(const PositionCompare& compare, const OutputConfig& output,
                           const AxisConfig& axis);

}  // namespace stepdriver::config
