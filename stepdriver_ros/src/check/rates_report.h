#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/machine/capability.h"

namespace stepdriver::check {

/// The times that were measured; without calls, those of the wake-ups alone.
std::string measurementsText(const std::vector<axis::AxisConfig>& axes,
                             const machine::Capability& capability);

/// Asked and held step rates, axis by axis.
std::string ratesText(const std::vector<machine::StepRate>& rates);

}  // namespace stepdriver::check
