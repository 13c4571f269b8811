#pragma once

#include <optional>
#include <vector>

#include "motor/motor_lines.h"
#include "pulse/heartbeat.h"
#include "pulse/pulse_engine.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::machine {

/// The lines of all axes and of the machine, in one request.
struct Wiring {
  /// Without the lines of the machine.
  explicit Wiring(const std::vector<config::AxisConfig>& axes);
  Wiring(const std::vector<config::AxisConfig>& axes, const MachineOptions& options);

  std::vector<gpio::OutputRequest> outputs;
  std::vector<gpio::InputRequest> inputs;
  std::vector<motor::MotorLines> motor_lines;  // by axis
  std::vector<pulse::ChannelConfig> channels;  // by axis
  std::vector<pulse::SharedAxes> shared;
  std::optional<pulse::Signal> emergency_stop;
  std::optional<pulse::HeartbeatLine> heartbeat;
};

}  // namespace stepdriver::machine
