#pragma once

#include <string>
#include <vector>

#include "requests.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::machine {

/// A request in words, as the flight recorder shows it: "x: move to 0.1 m".
std::string textOf(const Request& request, const std::vector<config::AxisConfig>& axes);

/// How a profile of the engine ended: "reached its end".
const char* textOf(pulse::EndReason reason);

}  // namespace stepdriver::machine
