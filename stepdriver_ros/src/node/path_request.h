#pragma once

#include <stepdriver/FollowPath.h>
#include <stepdriver/PathSegment.h>

#include "stepdriver_core/machine/coordinated_move.h"

namespace stepdriver::ros_node {

/// @throw Refused if a segment has no known shape, or an arc no plane or point.
machine::PathRequest pathRequest(const FollowPath::Request& fields);

}  // namespace stepdriver::ros_node
