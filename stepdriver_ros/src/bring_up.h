#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "node_config.h"
#include "simulation.h"

namespace stepdriver::ros_node {

/// Reads and checks everything that the node is told by parameters: its own and the robot
/// description, whose limits are applied. Prints the limits that hold.
///
/// @throw ConfigError with everything that is wrong. No line has been touched by then.
NodeConfig readParameters(const ros::NodeHandle& node, const ros::NodeHandle& private_node);

/// @param node_name full name of the node. @throw ConfigError where the trace can't be written.
std::unique_ptr<Simulation> makeSimulation(const NodeConfig& config, const std::string& node_name);

}  // namespace stepdriver::ros_node
