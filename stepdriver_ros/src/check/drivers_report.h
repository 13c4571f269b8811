#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::check {

/// A line for each finding; those that are wrong are marked.
std::string driversText(const std::vector<setup::DriverFinding>& findings);

}  // namespace stepdriver::check
