#pragma once

#include <ros/node_handle.h>

#include <string>

#include "common/end_requests.h"
#include "options.h"

namespace stepdriver::console {

/// The screen, from its first picture to the key that ends it, or to an end request.
///
/// @param driver full name of the node.
/// @throw Error where there is no terminal for it, ConfigError where the driver's parameters are
///   wrong.
void runConsole(const ros::NodeHandle& node, const std::string& driver, const Options& options,
                ros_node::EndRequests& end_requests);

}  // namespace stepdriver::console
