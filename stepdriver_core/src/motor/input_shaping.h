#pragma once

#include <memory>

#include "profile/input_shaper.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::motor {

/// The shaper of an axis, for all of its oscillations; nullptr if it has none.
std::shared_ptr<const motion::InputShaper> inputShaperOf(const config::AxisConfig& axis);

/// [s] How much later its motions end because of that.
double shapingTimeOf(const config::AxisConfig& axis);

}  // namespace stepdriver::motor
