#pragma once

#include <string>

#include "common/node_config.h"
#include "joystick_config.h"

namespace stepdriver::docs {

/// Every value of a configuration, for comparison.
std::string dump(const ros_node::NodeConfig& config);
std::string dump(const joystick::JoystickConfig& config);

}  // namespace stepdriver::docs
