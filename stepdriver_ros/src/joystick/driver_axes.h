#pragma once

#include <string>
#include <vector>

#include "joystick_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::joystick {

/// Compares the axes of a joystick with those of the driver: names, units and highest speeds.
/// Mistakes in the driver's own configuration are reported by the driver.
///
/// @param joystick, name the joystick's parameters as read by readJoystickConfig().
/// @param driver_axes the driver's parameter `axes`; nothing: not known yet, so everything is
///   accepted.
/// @param driver full name of the driver.
/// @param issues every mismatch is added here.
void checkDriverAxes(const JoystickConfig& joystick, const std::string& name,
                     const config::ConfigValue& driver_axes, const std::string& driver,
                     std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::joystick
