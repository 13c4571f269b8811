#pragma once

#include <string>

#include "channel/channel_state.h"
#include "line_names.h"
#include "motor/motor_lines.h"

namespace stepdriver::axis {

/// A line of an axis that could not be read or written, in words, with what to do about it.
std::string lineFailureText(const pulse::LineFailure& failure, const config::AxisConfig& axis,
                            const motor::MotorLines& own, const LineNames& names);

/// Whether it is one of its lines.
bool isLineOf(const pulse::LineFailure& failure, const motor::MotorLines& own);

}  // namespace stepdriver::axis
