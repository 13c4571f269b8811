#pragma once

#include <string>

#include "base_config.h"
#include "common/node_config.h"
#include "joystick_config.h"

namespace stepdriver::docs {

/// Every value of a configuration, for comparison.
std::string dump(const ros_node::NodeConfig& config);
std::string dump(const joystick::JoystickConfig& config);
std::string dump(const base::BaseConfig& config);

}  // namespace stepdriver::docs
