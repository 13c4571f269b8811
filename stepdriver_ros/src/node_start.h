#pragma once

#include <ros/node_handle.h>

#include <string>

#include "end_requests.h"
#include "stepdriver_core/axis/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// @return false: the node was asked to end before there was a master.
bool waitForMaster(EndRequests& end_requests);

/// @return the node's private parameters as one map, empty where there are none.
axis::ConfigValue privateParameters(const ros::NodeHandle& private_node);

/// Logs everything that is wrong in the parameters.
///
/// @param what_follows how the first line begins: "Not started".
void explain(const ConfigError& error, const std::string& what_follows);

}  // namespace stepdriver::ros_node
