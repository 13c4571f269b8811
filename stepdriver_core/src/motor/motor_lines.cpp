#include "motor_lines.h"

#include <algorithm>
#include <cmath>

#include "nanoseconds.h"
#include "profile/resting_count.h"

namespace stepdriver::motor {

static_assert(config::kMostMotors == pulse::kMostMotors);
static_assert(driver::kCoils == pulse::kCoils);

namespace {

/// Adds the lines of the motors of one axis to the requests.
class LineRequests {
 public:
  LineRequests(const config::AxisConfig& config, const std::vector<MotorLines>& others,
               std::vector<gpio::OutputRequest>& outputs, std::vector<gpio::InputRequest>& inputs)
      : config_(config),
        keep_(!config.disable_on_shutdown),
        others_(others),
        outputs_(outputs),
        inputs_(inputs) {}

  MotorLines add() {
    static_cast<ChipLines&>(lines_) = addMotor(config_);
    for (const config::MotorConfig& twin : config_.twins) lines_.twins.push_back(addMotor(twin));
    lines_.cw_ccw = config_.hasCwCcwInputs();
    return lines_;
  }

 private:
  ChipLines addMotor(const config::MotorConfig& motor) {
    const config::Pins& pins = motor.pins;
    const driver::DriverChip& chip = motor.driver;
    ChipLines lines;
    addEnable(motor, lines);
    lines.sleep = output(pins.sleep, chip.sleep_asleep.value_or(false), keep_);
    lines.reset = output(pins.reset, chip.reset_held.value_or(false), keep_);
    const auto code = driver::codeOf(chip, config_.microsteps);
    const std::array<const config::Pin*, 3> mode_pins = {&pins.ms1, &pins.ms2, &pins.ms3};
    for (std::size_t i = 0; i < mode_pins.size(); ++i) {
      lines.mode[i] = output(*mode_pins[i], code && (*code)[i], keep_);
    }
    if (config_.brake && lines_.brake < 0) {
      lines_.brake = output({config_.brake->line, false}, !config_.brake->release_level, false);
    }
    lines.dir = output(pins.dir, config_.hasCwCcwInputs() && !chip.step_active, false);
    // If each edge is a step, going back to the inactive level at the end could be one.
    lines.step = output(pins.step, !chip.step_active, chip.both_edges);
    for (std::size_t i = 0; i < lines.coils.size(); ++i) {
      lines.coils[i] = output(pins.coil(i), false, keep_);
    }
    lines.endstop_min = endstop(motor.endstop_min);
    lines.endstop_max = endstop(motor.endstop_max);
    lines.fault = input(motor.fault);
    lines.in_position = input(motor.in_position);
    return lines;
  }

  int output(const config::Pin& pin, bool chip_level, bool keep) {
    if (!pin.wired()) return -1;
    outputs_.push_back({pin.line, chip_level != pin.inverted, keep});
    return static_cast<int>(outputs_.size()) - 1;
  }

  template <typename InputPin>
  int input(const InputPin& pin) {
    if (!pin) return -1;
    inputs_.push_back({pin->line, pin->bias, true});
    return static_cast<int>(inputs_.size()) - 1;
  }

  int endstop(const std::optional<config::Endstop>& endstop) {
    if (endstop && endstop->shared) {
      const auto is_same = [&](const gpio::InputRequest& other) {
        return other.line == endstop->line;
      };
      const auto known = std::find_if(inputs_.begin(), inputs_.end(), is_same);
      if (known != inputs_.end()) return static_cast<int>(known - inputs_.begin());
    }
    return input(endstop);
  }

  void addEnable(const config::MotorConfig& motor, ChipLines& lines) {
    const config::Pin& enable = motor.pins.enable;
    if (!enable.wired()) return;
    if (const ChipLines* sharer = sharerOf(enable)) {
      lines.enable = sharer->enable;
      lines.enable_line = sharer->enable_line;
      bool& kept = outputs_[static_cast<std::size_t>(lines.enable)].keep_on_release;
      kept = kept || keep_;
      return;
    }
    lines.enable = output(enable, !motor.driver.enable_on, keep_);
    lines.enable_line = std::make_shared<EnableLine>();
  }

  /// The motor for which this ENABLE line was requested; nullptr: none yet.
  const ChipLines* sharerOf(const config::Pin& enable) const {
    const auto among = [&](const MotorLines& axis) -> const ChipLines* {
      for (std::size_t i = 0; i < axis.motors(); ++i) {
        const int line = axis.motorAt(i).enable;
        if (line >= 0 && outputs_[static_cast<std::size_t>(line)].line == enable.line) {
          return &axis.motorAt(i);
        }
      }
      return nullptr;
    };
    for (const MotorLines& other : others_) {
      if (const ChipLines* sharer = among(other)) return sharer;
    }
    return among(lines_);
  }

  const config::AxisConfig& config_;
  const bool keep_;
  const std::vector<MotorLines>& others_;
  std::vector<gpio::OutputRequest>& outputs_;
  std::vector<gpio::InputRequest>& inputs_;
  MotorLines lines_;
};

pulse::MotorSignals signalsOf(const config::MotorConfig& motor, const ChipLines& lines,
                              bool cw_ccw) {
  const driver::DriverChip& chip = motor.driver;
  pulse::MotorSignals signals;
  signals.step = {lines.step, chip.step_active != motor.pins.step.inverted};
  signals.dir = {lines.dir, (chip.step_active || !cw_ccw) != motor.pins.dir.inverted};
  for (std::size_t i = 0; i < lines.coils.size(); ++i) {
    signals.coils[i] = {lines.coils[i], !motor.pins.coil(i).inverted};
  }
  if (motor.endstop_min) {
    signals.endstop_min = pulse::Signal{lines.endstop_min, motor.endstop_min->active_level};
  }
  if (motor.endstop_max) {
    signals.endstop_max = pulse::Signal{lines.endstop_max, motor.endstop_max->active_level};
  }
  if (motor.fault) signals.fault = pulse::Signal{lines.fault, chip.fault_active.value_or(false)};
  if (motor.in_position) {
    signals.in_position = pulse::Signal{lines.in_position, chip.in_position_active.value_or(false)};
  }
  return signals;
}

/// The steps of an electrical cycle, from Home: in full steps, each second half step.
std::vector<pulse::CoilSet> patternsOf(const config::AxisConfig& config) {
  std::vector<pulse::CoilSet> patterns;
  if (!config.hasPhases()) return patterns;
  constexpr auto kHalfStepsPerFullStep = driver::kHalfSteps.size() / driver::kFullStepsPerCycle;
  const std::size_t by = kHalfStepsPerFullStep / static_cast<std::size_t>(config.microsteps);
  for (std::size_t i = 0; i < driver::kHalfSteps.size(); i += by) {
    patterns.push_back(driver::kHalfSteps.at(i));
  }
  return patterns;
}

}  // namespace

MotorLines requestLines(const config::AxisConfig& config, const std::vector<MotorLines>& others,
                        std::vector<gpio::OutputRequest>& outputs,
                        std::vector<gpio::InputRequest>& inputs) {
  return LineRequests(config, others, outputs, inputs).add();
}

pulse::ChannelConfig channelConfig(const config::AxisConfig& config, const MotorLines& lines) {
  pulse::ChannelConfig channel;
  for (std::size_t i = 0; i < config.motors(); ++i) {
    const config::MotorConfig& motor = config.motorAt(i);
    const pulse::MotorSignals signals = signalsOf(motor, lines.motorAt(i), lines.cw_ccw);
    if (i == 0) {
      static_cast<pulse::MotorSignals&>(channel) = signals;
    } else {
      channel.twins.push_back(signals);
    }
    channel.ramps_at_fault = channel.ramps_at_fault || motor.fault_ramps;
    if (motor.in_position) {
      channel.in_position_timeout =
          std::max(channel.in_position_timeout, nanoseconds(motor.in_position->timeout));
    }
  }
  const driver::Timing timing = config.timing();
  channel.both_edges = config.stepsOnBothEdges();
  channel.dir_steps = lines.cw_ccw;
  channel.patterns = patternsOf(config);
  channel.step_high = timing.step_high_ns;
  channel.step_low = timing.step_low_ns;
  channel.dir_setup = timing.dir_setup_ns;
  channel.dir_hold = timing.dir_hold_ns;
  channel.switch_release = config.switch_release * config.steps_per_unit;
  if (config.assumed_end_is_max) {
    channel.assumed_end = *config.assumed_end_is_max ? pulse::AxisEnd::kMax : pulse::AxisEnd::kMin;
  }
  channel.backlash = config.backlash * config.steps_per_unit;
  channel.max_skew = motion::restingCount(config.max_skew * config.steps_per_unit);
  return channel;
}

}  // namespace stepdriver::motor
