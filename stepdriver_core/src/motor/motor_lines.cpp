#include "motor_lines.h"

#include <cmath>

namespace stepdriver::motor {

namespace {

/// The axis for which this ENABLE line was requested; nullptr: no axis yet.
const MotorLines* sharerOf(const config::Pin& enable, const std::vector<MotorLines>& others,
                           const std::vector<gpio::OutputRequest>& outputs) {
  for (const MotorLines& other : others) {
    if (other.enable < 0 || !enable.wired()) continue;
    if (outputs[static_cast<std::size_t>(other.enable)].line == enable.line) return &other;
  }
  return nullptr;
}

}  // namespace

MotorLines requestLines(const config::AxisConfig& config, const std::vector<MotorLines>& others,
                        std::vector<gpio::OutputRequest>& outputs,
                        std::vector<gpio::InputRequest>& inputs) {
  const driver::DriverChip& chip = config.driver;
  const auto output = [&outputs](const config::Pin& pin, bool chip_level, bool keep) {
    if (!pin.wired()) return -1;
    outputs.push_back({pin.line, chip_level != pin.inverted, keep});
    return static_cast<int>(outputs.size()) - 1;
  };
  const auto input = [&inputs](const auto& pin) {
    if (!pin) return -1;
    inputs.push_back({pin->line, pin->bias, true});
    return static_cast<int>(inputs.size()) - 1;
  };

  const bool keep = !config.disable_on_shutdown;
  const config::Pins& pins = config.pins;
  MotorLines lines;
  if (const MotorLines* sharer = sharerOf(pins.enable, others, outputs)) {
    lines.enable = sharer->enable;
    lines.enable_line = sharer->enable_line;
    bool& kept = outputs[static_cast<std::size_t>(lines.enable)].keep_on_release;
    kept = kept || keep;
  } else {
    lines.enable = output(pins.enable, !chip.enable_on, keep);
    if (pins.enable.wired()) lines.enable_line = std::make_shared<EnableLine>();
  }
  lines.sleep = output(pins.sleep, chip.sleep_asleep.value_or(false), keep);
  lines.reset = output(pins.reset, chip.reset_held.value_or(false), keep);
  const auto code = driver::codeOf(chip, config.microsteps);
  const std::array<const config::Pin*, 3> mode_pins = {&pins.ms1, &pins.ms2, &pins.ms3};
  for (std::size_t i = 0; i < mode_pins.size(); ++i) {
    lines.mode[i] = output(*mode_pins[i], code && (*code)[i], keep);
  }
  if (config.brake) {
    lines.brake = output({config.brake->line, false}, !config.brake->release_level, false);
  }
  lines.cw_ccw = chip.step_inputs == driver::StepInputs::kCwCcw;
  lines.dir = output(pins.dir, lines.cw_ccw && !chip.step_active, false);
  // If each edge is a step, going back to the inactive level at the end could be one.
  lines.step = output(pins.step, !chip.step_active, chip.both_edges);
  lines.endstop_min = input(config.endstop_min);
  lines.endstop_max = input(config.endstop_max);
  lines.fault = input(config.fault);
  lines.in_position = input(config.in_position);
  return lines;
}

pulse::ChannelConfig channelConfig(const config::AxisConfig& config, const MotorLines& lines) {
  const driver::DriverChip& chip = config.driver;
  pulse::ChannelConfig channel;
  channel.step = {lines.step, chip.step_active != config.pins.step.inverted};
  channel.both_edges = chip.both_edges;
  channel.dir_steps = lines.cw_ccw;
  channel.dir = {lines.dir, (chip.step_active || !lines.cw_ccw) != config.pins.dir.inverted};
  if (config.endstop_min) {
    channel.endstop_min = pulse::Signal{lines.endstop_min, config.endstop_min->active_level};
  }
  if (config.endstop_max) {
    channel.endstop_max = pulse::Signal{lines.endstop_max, config.endstop_max->active_level};
  }
  if (config.fault) {
    channel.fault = pulse::Signal{lines.fault, chip.fault_active.value_or(false)};
    channel.ramps_at_fault = config.fault->ramps;
  }
  if (config.in_position) {
    channel.in_position = pulse::Signal{lines.in_position, chip.in_position_active.value_or(false)};
    channel.in_position_timeout = std::llround(config.in_position->timeout * 1e9);
  }
  channel.step_high = config.driver.timing.step_high_ns;
  channel.step_low = config.driver.timing.step_low_ns;
  channel.dir_setup = config.driver.timing.dir_setup_ns;
  channel.dir_hold = config.driver.timing.dir_hold_ns;
  channel.backlash = std::llround(config.backlash * config.steps_per_unit);
  return channel;
}

}  // namespace stepdriver::motor
