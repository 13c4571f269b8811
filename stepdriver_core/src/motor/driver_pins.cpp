#include "driver_pins.h"

#include <algorithm>
#include <array>

namespace stepdriver::motor {

DriverPins::DriverPins(const config::AxisConfig& config, const MotorLines& lines)
    : config_(config), chip_(driver::driverChipOf(config.driver)), lines_(lines) {}

PinSequence DriverPins::bringUp() const {
  const driver::Timing& timing = config_.timing;
  const bool awake = chip_.sleep_asleep == config_.pins.sleep.inverted;
  const bool held = chip_.reset_held != config_.pins.reset.inverted;
  PinSequence sequence;
  if (hasSleep()) sequence.add(lines_.sleep, awake, hasReset() ? 0 : timing.wake_ns);
  if (hasReset()) {
    sequence.add(lines_.reset, held, timing.reset_low_ns);
    sequence.add(
        lines_.reset, !held,
        hasSleep() ? std::max(timing.wake_ns, timing.reset_wait_ns) : timing.reset_wait_ns);
  }
  return sequence;
}

PinSequence DriverPins::enable(bool on) const {
  const bool level = (chip_.enable_on == on) != config_.pins.enable.inverted;
  PinSequence sequence;
  sequence.add(lines_.enable, level, on ? config_.timing.enable_ns : 0);
  return sequence;
}

PinSequence DriverPins::sleep(bool asleep) const {
  const bool level = (chip_.sleep_asleep == asleep) != config_.pins.sleep.inverted;
  PinSequence sequence;
  sequence.add(lines_.sleep, level, asleep ? 0 : config_.timing.wake_ns);
  return sequence;
}

PinSequence DriverPins::reset() const {
  const bool held = chip_.reset_held != config_.pins.reset.inverted;
  PinSequence sequence;
  sequence.add(lines_.reset, held, config_.timing.reset_low_ns);
  sequence.add(lines_.reset, !held, config_.timing.reset_wait_ns);
  return sequence;
}

PinSequence DriverPins::mode(int from_microsteps, int to_microsteps) const {
  const std::array<const config::Pin*, 3> pins = {&config_.pins.ms1, &config_.pins.ms2,
                                                  &config_.pins.ms3};
  PinSequence sequence;
  driver::ModeCode code = *driver::codeOf(chip_, from_microsteps);
  for (const driver::ModeCode& next : driver::modePath(chip_, from_microsteps, to_microsteps)) {
    for (std::size_t i = 0; i < pins.size(); ++i) {
      if (next[i] == code[i]) continue;
      sequence.add(lines_.mode[i], next[i] != pins[i]->inverted, config_.timing.mode_setup_ns);
    }
    code = next;
  }
  return sequence;
}

PinSequence DriverPins::restore(bool enabled, bool asleep) const {
  PinSequence sequence;
  sequence.add(lines_.step, chip_.step_active == config_.pins.step.inverted,
               config_.timing.step_low_ns);
  const auto append = [&sequence](const PinSequence& part) {
    const auto& last = part.writes[part.size - 1];
    sequence.add(last.line, last.level, last.then_wait);
  };
  if (hasSleep()) append(sleep(asleep));
  if (hasReset()) append(reset());
  if (hasEnable()) append(enable(enabled));
  return sequence;
}

}  // namespace stepdriver::motor
