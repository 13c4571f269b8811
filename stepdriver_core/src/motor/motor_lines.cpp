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
  const driver::DriverChip& chip = driver::driverChipOf(config.driver);
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
  lines.sleep = output(pins.sleep, chip.sleep_asleep, keep);
  lines.reset = output(pins.reset, chip.reset_held, keep);
  const auto code = driver::codeOf(chip, config.microsteps);
  const std::array<const config::Pin*, 3> mode_pins = {&pins.ms1, &pins.ms2, &pins.ms3};
  for (std::size_t i = 0; i < mode_pins.size(); ++i) {
    lines.mode[i] = output(*mode_pins[i], code && (*code)[i], keep);
  }
  lines.dir = output(pins.dir, false, false);
  lines.step = output(pins.step, !chip.step_active, false);
  lines.endstop_min = input(config.endstop_min);
  lines.endstop_max = input(config.endstop_max);
  lines.fault = input(config.fault);
  return lines;
}

pulse::ChannelConfig channelConfig(const config::AxisConfig& config, const MotorLines& lines) {
  const driver::DriverChip& chip = driver::driverChipOf(config.driver);
  pulse::ChannelConfig channel;
  channel.step = {lines.step, chip.step_active != config.pins.step.inverted};
  channel.dir = {lines.dir, !config.pins.dir.inverted};
  if (config.endstop_min) {
    channel.endstop_min = pulse::Signal{lines.endstop_min, config.endstop_min->active_level};
  }
  if (config.endstop_max) {
    channel.endstop_max = pulse::Signal{lines.endstop_max, config.endstop_max->active_level};
  }
  if (config.fault) channel.fault = pulse::Signal{lines.fault, false};
  channel.step_high = config.timing.step_high_ns;
  channel.step_low = config.timing.step_low_ns;
  channel.dir_setup = config.timing.dir_setup_ns;
  channel.dir_hold = config.timing.dir_hold_ns;
  channel.backlash = std::llround(config.backlash * config.steps_per_unit);
  return channel;
}

}  // namespace stepdriver::motor
