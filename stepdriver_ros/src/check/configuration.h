#pragma once

#include <string>

#include "common/node_config.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::check {

using setup::BackendChoice;

/// Reads a file as the node reads its parameters. If the file names no backend, which the launch
/// files set, libgpiod is assumed.
/// @throw Error if it isn't YAML.
/// @throw ConfigError listing every mistake.
ros_node::NodeConfig readConfiguration(const std::string& path, BackendChoice choice);

/// The axes with their top speeds.
std::string configurationText(const ros_node::NodeConfig& config);

}  // namespace stepdriver::check
