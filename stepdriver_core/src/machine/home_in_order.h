#pragma once

#include <functional>
#include <vector>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::machine {

/// Machine::home() of these axes.
std::vector<axis::HomingResult> homeInOrder(const std::vector<axis::Axis*>& axes,
                                            const std::function<bool()>& cancelled);

}  // namespace stepdriver::machine
