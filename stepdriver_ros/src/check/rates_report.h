#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/step_rates.h"
#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::check {

/// The measured times. Without channels, it has only those of the wake-ups.
std::string measurementsText(const std::vector<config::AxisConfig>& axes,
                             const pulse::Capability& capability);

/// The needed and the sustainable step rates and revolutions per minute, axis by axis.
std::string ratesText(const machine::StepRates& rates);

/// The axes that need more than the computer can sustain: `x, y`.
std::string tooFast(const machine::StepRates& rates);

}  // namespace stepdriver::check
