#pragma once

#include <ros/node_handle.h>

#include "common/node_config.h"

namespace stepdriver::ros_node {

/// Reads and checks everything that the node is told by parameters: its own and the robot
/// description, whose limits are applied. Prints the limits that hold.
///
/// @throw ConfigError with everything that is wrong. No line has been touched by then.
NodeConfig readParameters(const ros::NodeHandle& node, const ros::NodeHandle& private_node);

}  // namespace stepdriver::ros_node
