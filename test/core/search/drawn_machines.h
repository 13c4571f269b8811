#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::search {

/// The next number from 0 to 1, of a generator or of the input of a fuzz target.
using Draw = std::function<double()>;

/// The machine of a variant with other numbers: scales, speeds, accelerations, jerks, start speeds,
/// backlashes, shapers and matrices in decades, a fifth of them at the bounds of what the reader
/// accepts. What a run waits for ends within its time: no stop takes longer than half a minute.
std::vector<config::AxisConfig> drawMachine(int variant, const Draw& draw);

/// Its numbers, for messages.
std::string describe(const config::AxisConfig& axis);

}  // namespace stepdriver::search
