#include "wiring.h"

#include <algorithm>

#include "config/least_time.h"
#include "motor/input_shaping.h"
#include "nanoseconds.h"
#include "pulse/measure.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::machine {
namespace {

// In microsteps instead of units.
pulse::SharedAxes sharedAxes(const config::Kinematics& kinematics,
                             const std::vector<config::AxisConfig>& axes) {
  pulse::SharedAxes shared;
  for (const std::string& name : kinematics.axes) {
    const auto axis = std::find_if(axes.begin(), axes.end(),
                                   [&](const auto& other) { return other.name == name; });
    shared.channels.push_back(static_cast<std::size_t>(axis - axes.begin()));
  }
  const auto scale = [&](std::size_t i) { return axes.at(shared.channels[i]).steps_per_unit; };
  const auto scaled = [&](config::Matrix matrix) {
    for (std::size_t i = 0; i < matrix.size(); ++i) {
      for (std::size_t k = 0; k < matrix.size(); ++k) matrix[i][k] *= scale(i) / scale(k);
    }
    return matrix;
  };
  shared.matrix = scaled(kinematics.matrix);
  shared.inverse = scaled(kinematics.inverse);
  return shared;
}

}  // namespace

Wiring::Wiring(const std::vector<config::AxisConfig>& axes) {
  for (const config::AxisConfig& axis : axes) {
    motor_lines.push_back(motor::requestLines(axis, motor_lines, outputs, inputs));
    channels.push_back(motor::channelConfig(axis, motor_lines.back()));
    const auto& kinematics = axis.kinematics;
    if (kinematics && axis.name == kinematics->axes.front()) {
      shared.push_back(sharedAxes(*kinematics, axes));
    }
  }
}

Wiring::Wiring(const std::vector<config::AxisConfig>& axes, const MachineOptions& options)
    : Wiring(axes) {
  for (pulse::ChannelConfig& channel : channels) channel.late_steps = options.late_steps;
  if (const auto& button = options.emergency_stop) {
    emergency_stop = pulse::Signal{static_cast<int>(inputs.size()), button->active_level};
    inputs.push_back({button->line, button->bias, true});
  }
  if (options.heartbeat) {
    heartbeat = pulse::HeartbeatLine{static_cast<int>(outputs.size()),
                                     nanoseconds(0.5 / options.heartbeat->rate)};
    outputs.push_back({options.heartbeat->line, false, false});
  }
  if (const auto& power = options.motor_power) {
    motor_power.emplace();
    motor_power->output = static_cast<int>(outputs.size());
    outputs.push_back({power->line, !power->active_level, false});
    if (power->feedback) {
      motor_power->feedback = static_cast<int>(inputs.size());
      inputs.push_back({power->feedback->line, power->feedback->bias, true});
    }
  }
  for (const config::OutputConfig& output : options.outputs) {
    named_outputs.push_back(static_cast<int>(outputs.size()));
    outputs.push_back({output.line, output.level(output.at_fault), false});
  }
  for (const config::InputConfig& input : options.inputs) {
    named_inputs.push_back(static_cast<int>(inputs.size()));
    inputs.push_back({input.line.line, input.line.bias, true});
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i].homing) connectHoming(*axes[i].homing, options, i);
  }
}

void Wiring::connectHoming(const config::HomingConfig& homing, const MachineOptions& options,
                           std::size_t axis) {
  motor::MotorLines& lines = motor_lines[axis];
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    const config::InputConfig& input = options.inputs[i];
    const motor::SensorLine line{{named_inputs[i], input.line.active_level}, input.debounce_ns};
    if (input.name == homing.input) lines.homing_input = line;
    if (input.name == homing.flag) lines.homing_flag = line;
  }
  if (homing.kind == config::HomingKind::kStall) channels[axis].block_is_fault = true;
  if (homing.kind != config::HomingKind::kBlock) return;
  if (lines.homing_input) channels[axis].block = lines.homing_input->signal;
  channels[axis].block_is_fault = homing.input.empty();
}

std::vector<pulse::OutputLine> Wiring::switchedOutputs(const MachineOptions& options) const {
  std::vector<pulse::OutputLine> switched;
  for (std::size_t i = 0; i < options.outputs.size(); ++i) {
    const config::OutputConfig& output = options.outputs[i];
    switched.push_back({named_outputs[i], output.active_level, config::leastTime(output, true).ns,
                        config::leastTime(output, false).ns,
                        output.max_on_ns.value_or(pulse::kNever),
                        nanoseconds(options.write_timeout)});
  }
  return switched;
}

pulse::Nanoseconds longestRamp(const std::vector<config::AxisConfig>& axes) {
  double longest = 0.0;
  for (const config::AxisConfig& axis : axes) {
    const double deceleration = axis.stop_deceleration.value_or(axis.deceleration);
    double time = axis.max_speed / deceleration;
    if (axis.jerk > 0.0) {
      time += (deceleration + std::max(axis.acceleration, axis.deceleration)) / axis.jerk;
    }
    longest = std::max(longest, time + motor::shapingTimeOf(axis));
  }
  return nanoseconds(1.1 * longest + 0.1);
}

std::vector<bool> Wiring::safeLevels() const {
  std::vector<bool> levels;
  for (const gpio::OutputRequest& output : outputs) levels.push_back(output.safe_level);
  return levels;
}

pulse::Capability measure(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock, const pulse::RealtimeRequest& request) {
  config::checkAxes(axes);
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return pulse::measureCapability(*lines, clock, wiring.channels, request);
}

}  // namespace stepdriver::machine
