#pragma once

#include <ros/node_handle.h>

#include <string>

#include "common/end_requests.h"
#include "options.h"

namespace stepdriver::console {

/// Runs the screen until a key or an end request ends it.
///
/// @param driver full name of the node.
/// @throw Error if there is no suitable terminal, ConfigError if the driver's parameters are wrong.
void runConsole(const ros::NodeHandle& node, const std::string& driver, const Options& options,
                ros_node::EndRequests& end_requests);

}  // namespace stepdriver::console
