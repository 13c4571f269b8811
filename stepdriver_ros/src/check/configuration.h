#pragma once

#include <string>

#include "common/node_config.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::check {

using setup::BackendChoice;

/// Reads a file as the node reads its parameters. A file that names no backend, as the launch files
/// have it, is taken to mean libgpiod.
///
/// @throw Error where it isn't YAML. @throw ConfigError with everything that is wrong.
ros_node::NodeConfig readConfiguration(const std::string& path, BackendChoice choice);

/// The axes with their top speeds.
std::string configurationText(const ros_node::NodeConfig& config);

}  // namespace stepdriver::check
