#pragma once

#include <vector>

#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::driver {

/// The data of all named chips, in the order in which pages and messages list them.
const std::vector<DriverChip>& namedChips();

}  // namespace stepdriver::driver
