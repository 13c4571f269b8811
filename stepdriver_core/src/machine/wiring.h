#pragma once

#include <optional>
#include <vector>

#include "motor/motor_lines.h"
#include "pulse/pulse_engine.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::machine {

/// The lines of all axes, in one request.
struct Wiring {
  explicit Wiring(const std::vector<config::AxisConfig>& axes,
                  const std::optional<config::InputSwitch>& emergency = {});

  std::vector<gpio::OutputRequest> outputs;
  std::vector<gpio::InputRequest> inputs;
  std::vector<motor::MotorLines> motor_lines;  // by axis
  std::vector<pulse::ChannelConfig> channels;  // by axis
  std::optional<pulse::Signal> emergency_stop;
};

}  // namespace stepdriver::machine
