#pragma once

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

/// The start of a node's main(), before ros::init(). Makes the output line-buffered, and answers
/// arguments that aren't for ROS with the usage, and names the one that isn't known.
///
/// @return the exit code if the program must end now.
std::optional<int> handleArguments(int argc, char** argv, const std::string& usage);

/// @return false: the node was asked to end before there was a master.
bool waitForMaster(EndRequests& end_requests);

/// @param node_name full name of a node.
/// @return its private parameters as one map, empty if there are none. The keys of `axes` have the
///   order in which they were set, which is that of the file.
config::ConfigValue privateParameters(const std::string& node_name);

/// Logs all mistakes in the parameters. If some of them may be left over from an earlier launch, it
/// says how to delete them.
///
/// @param node_name full name of the node.
/// @param what_follows the beginning of the first line: "Not started".
void explain(const ConfigError& error, const std::string& node_name,
             const std::string& what_follows);

}  // namespace stepdriver::ros_node
