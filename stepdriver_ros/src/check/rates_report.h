#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/step_rates.h"
#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::check {

/// The times that were measured; without channels, those of the wake-ups alone.
std::string measurementsText(const std::vector<config::AxisConfig>& axes,
                             const pulse::Capability& capability);

/// Asked and held step rates, axis by axis.
std::string ratesText(const machine::StepRates& rates);

/// The axes that ask for more than can be held: `x, y`.
std::string tooFast(const machine::StepRates& rates);

}  // namespace stepdriver::check
