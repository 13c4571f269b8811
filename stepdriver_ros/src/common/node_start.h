#pragma once

#include <ros/node_handle.h>

#include <optional>
#include <string>

#include "end_requests.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

// Exit codes that the nodes share.
constexpr int kExitOk = 0;
constexpr int kExitConfig = 1;
constexpr int kExitUsage = 64;

/// What a node's main() begins with, before ros::init(): each line of its output can be read when
/// it is written, and what isn't for ROS among its arguments is answered with the usage.
///
/// @return the exit code where the program ends with that.
std::optional<int> handleArguments(int argc, char** argv, const char* usage);

/// @return false: the node was asked to end before there was a master.
bool waitForMaster(EndRequests& end_requests);

/// @return the node's private parameters as one map, empty where there are none.
config::ConfigValue privateParameters(const ros::NodeHandle& private_node);

/// Logs everything that is wrong in the parameters. If some of them may be left over from an
/// earlier launch, it says how to delete them.
///
/// @param node_name full name of the node.
/// @param what_follows how the first line begins: "Not started".
void explain(const ConfigError& error, const std::string& node_name,
             const std::string& what_follows);

}  // namespace stepdriver::ros_node
