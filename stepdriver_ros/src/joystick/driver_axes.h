#pragma once

#include <string>
#include <vector>

#include "joystick_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::joystick {

/// Holds the axes of a joystick against those of the driver: its names, units and highest speeds.
/// What is wrong with the driver's own configuration is for the driver to say.
///
/// @param joystick, name the joystick's parameters as readJoystickConfig() took them.
/// @param driver_axes the driver's parameter `axes`; nothing: not known yet, all is right.
/// @param driver full name of the driver.
/// @param issues everything that doesn't fit is added here.
void checkDriverAxes(const JoystickConfig& joystick, const std::string& name,
                     const config::ConfigValue& driver_axes, const std::string& driver,
                     std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::joystick
