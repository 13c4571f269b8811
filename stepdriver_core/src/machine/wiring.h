#pragma once

#include <optional>
#include <vector>

#include "activity/motor_power.h"
#include "motor/motor_lines.h"
#include "named_lines.h"
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
  std::optional<activity::MotorPowerLines> motor_power;
  std::vector<int> named_outputs;  // in the order of MachineOptions::outputs
  std::vector<int> named_inputs;

  /// Of all outputs, see gpio::OutputRequest.
  std::vector<bool> safeLevels() const;

  /// @param options those that it was made of.
  activity::MotorPower motorPower(const MachineOptions& options) const {
    if (!motor_power) return {};
    return {*options.motor_power, *motor_power};
  }
  std::vector<pulse::OutputLine> switchedOutputs(const MachineOptions& options) const;
  NamedLines namedLines(const MachineOptions& options) const {
    return {NamedOutputs(options.outputs, named_outputs),
            NamedInputs(options.inputs, named_inputs)};
  }

 private:
  void connectHoming(const config::HomingConfig& homing, const MachineOptions& options,
                     std::size_t axis);
};

/// How long the ramp of an emergency stop may take: the longest deceleration from the top speed of
/// any axis, with a margin for the way to a whole microstep and for pulses that are late.
pulse::Nanoseconds longestRamp(const std::vector<config::AxisConfig>& axes);

}  // namespace stepdriver::machine
