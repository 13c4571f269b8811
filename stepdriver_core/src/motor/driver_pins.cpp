#include "driver_pins.h"

#include <algorithm>
#include <array>

namespace stepdriver::motor {

DriverPins::DriverPins(const config::AxisConfig& config, const MotorLines& lines)
    : config_(config), lines_(lines) {}

PinSequence DriverPins::bringUp() const {
  const driver::Timing& timing = config_.driver.timing;
  const bool awake = config_.driver.sleep_asleep.value_or(false) == config_.pins.sleep.inverted;
  const bool held = config_.driver.reset_held.value_or(false) != config_.pins.reset.inverted;
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
  const bool level = (config_.driver.enable_on == on) != config_.pins.enable.inverted;
  PinSequence sequence;
  sequence.add(lines_.enable, level, on ? config_.driver.timing.enable_ns : 0);
  return sequence;
}

PinSequence DriverPins::sleep(bool asleep) const {
  const bool level =
      (config_.driver.sleep_asleep.value_or(false) == asleep) != config_.pins.sleep.inverted;
  PinSequence sequence;
  sequence.add(lines_.sleep, level, asleep ? 0 : config_.driver.timing.wake_ns);
  return sequence;
}

PinSequence DriverPins::reset() const {
  const bool held = config_.driver.reset_held.value_or(false) != config_.pins.reset.inverted;
  PinSequence sequence;
  sequence.add(lines_.reset, held, config_.driver.timing.reset_low_ns);
  sequence.add(lines_.reset, !held, config_.driver.timing.reset_wait_ns);
  return sequence;
}

PinSequence DriverPins::mode(int from_microsteps, int to_microsteps) const {
  const std::array<const config::Pin*, 3> pins = {&config_.pins.ms1, &config_.pins.ms2,
                                                  &config_.pins.ms3};
  PinSequence sequence;
  driver::ModeCode code = *driver::codeOf(config_.driver, from_microsteps);
  for (const driver::ModeCode& next :
       driver::modePath(config_.driver, from_microsteps, to_microsteps)) {
    for (std::size_t i = 0; i < pins.size(); ++i) {
      if (next[i] == code[i]) continue;
      sequence.add(lines_.mode[i], next[i] != pins[i]->inverted,
                   config_.driver.timing.mode_setup_ns);
    }
    code = next;
  }
  return sequence;
}

PinSequence DriverPins::restore(bool enabled, bool asleep) const {
  PinSequence sequence;
  const auto end_pulse = [&](int line, const config::Pin& pin) {
    sequence.add(line, config_.driver.step_active == pin.inverted,
                 config_.driver.timing.step_low_ns);
  };
  // If each edge is a step, the line has no level to go back to.
  if (!config_.driver.both_edges) end_pulse(lines_.step, config_.pins.step);
  if (lines_.cw_ccw) end_pulse(lines_.dir, config_.pins.dir);
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
