#pragma once

#include <stepdriver/LatchGoal.h>

#include "stepdriver_core/machine/io.h"

namespace stepdriver::ros_node {

/// @throw Refused if it asks for edges that there aren't.
machine::LatchRequest latchRequest(const LatchGoal& goal);

}  // namespace stepdriver::ros_node
