#pragma once

#include <string>

#include "node_config.h"

namespace stepdriver::check {

/// Where a file is to be checked with other lines than it asks for.
enum class BackendChoice { kAsInTheFile, kSimulated, kLibgpiod };

/// Reads a file as the node reads its parameters. A file that names no backend, as the launch files
/// have it, is taken to mean libgpiod.
///
/// @throw Error where it isn't YAML. @throw ConfigError with everything that is wrong.
ros_node::NodeConfig readConfiguration(const std::string& path, BackendChoice choice);

/// The axes with their top speeds.
std::string configurationText(const ros_node::NodeConfig& config);

}  // namespace stepdriver::check
