#pragma once

#include <ros/node_handle.h>

#include "common/node_config.h"

namespace stepdriver::ros_node {

/// Reads and checks all parameters of the node: its own and the robot description, whose limits it
/// applies. Logs the resulting limits.
///
/// @throw ConfigError listing every mistake. No line has been touched by then.
NodeConfig readParameters(const ros::NodeHandle& node, const ros::NodeHandle& private_node);

}  // namespace stepdriver::ros_node
