#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"
#include "stick.h"

namespace stepdriver::joystick {

/// The key of the highest speed of an axis of this kind, here and in the driver's configuration.
const char* speedKey(config::Kind kind);

/// One axis of the driver, and the stick that jogs it.
struct JogAxis {
  std::string name;
  int joystick_axis = 0;  ///< index in sensor_msgs/Joy's axes
  config::Kind kind = config::Kind::kLinear;
  double max_speed = 0.0;  ///< [mm/s|deg/s] as configured
  Stick stick;
  bool disable_in_dead_band = false;
  double disable_after = 1.0;  ///< [s] in the dead band
};

/// All parameters of the node.
struct JoystickConfig {
  std::string driver = "stepdriver";  ///< the name of the node that drives the axes
  double rate = 25.0;                 ///< [Hz] of the jog messages while a stick is deflected
  double joy_timeout = 0.5;  ///< [s] without a message from the joystick until all jogs end
  int deadman_button = -1;   ///< index of the button that must be held; -1: no button
  std::vector<JogAxis> axes;
};

/// Reads the node's private parameters.
///
/// @code{.yaml}
/// driver: stepdriver          # name of the stepdriver_node, as it is or in the namespace
/// rate: 25.0                  # [Hz] from 1 to 1000; well above 1/jog_timeout of the driver
/// joy_timeout: 0.5            # [s] from 0.02 to 60
/// deadman_button: -1          # index of the button to be held; -1: none
/// axes:
///   x:                        # name of an axis of the driver
///     joystick_axis: 0        # index of the stick, from 0
///     max_speed_mm_s: 50.0    # or max_speed_deg_s of a rotary axis; at most the driver's own
///     inverted: false
///     dead_band: 0.1          # from 0 to 0.99 of the full deflection
///     exponent: 1.0           # from 0.1 to 10
///     disable_in_dead_band: false
///     disable_after_s: 1.0    # [s] from 0 to 3600
/// @endcode
///
/// @param tree all of them, as one map.
/// @param name the node's full name.
/// @param issues every mistake is added here.
/// @return to be used only if no issue was added.
JoystickConfig readJoystickConfig(const config::ConfigValue& tree, const std::string& name,
                                  std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::joystick
