#pragma once

#include <stepdriver/SetPositionCompare.h>

#include "stepdriver_core/config/io_config.h"

namespace stepdriver::ros_node {

/// @throw Refused if a time or a direction is out of its range, or the arrays of cams don't match.
config::PositionCompare positionCompare(const SetPositionCompare::Request& fields);

}  // namespace stepdriver::ros_node
