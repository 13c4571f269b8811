#include "chip_pins.h"

#include <algorithm>
#include <array>

namespace stepdriver::axis {

ChipPins::ChipPins(const AxisConfig& config, const AxisLines& lines)
    : config_(config), chip_(chip::chipOf(config.driver)), lines_(lines) {}

pulse::PinSequence ChipPins::bringUp() const {
  const chip::Timing& timing = config_.timing;
  const bool awake = chip_.sleep_asleep == config_.pins.sleep.inverted;
  const bool held = chip_.reset_held != config_.pins.reset.inverted;
  pulse::PinSequence sequence;
  if (hasSleep()) sequence.add(lines_.sleep, awake, hasReset() ? 0 : timing.wake_ns);
  if (hasReset()) {
    sequence.add(lines_.reset, held, timing.reset_low_ns);
    sequence.add(
        lines_.reset, !held,
        hasSleep() ? std::max(timing.wake_ns, timing.reset_wait_ns) : timing.reset_wait_ns);
  }
  return sequence;
}

pulse::PinSequence ChipPins::enable(bool on) const {
  const bool level = (chip_.enable_on == on) != config_.pins.enable.inverted;
  pulse::PinSequence sequence;
  sequence.add(lines_.enable, level, on ? config_.timing.enable_ns : 0);
  return sequence;
}

pulse::PinSequence ChipPins::sleep(bool asleep) const {
  const bool level = (chip_.sleep_asleep == asleep) != config_.pins.sleep.inverted;
  pulse::PinSequence sequence;
  sequence.add(lines_.sleep, level, asleep ? 0 : config_.timing.wake_ns);
  return sequence;
}

pulse::PinSequence ChipPins::reset() const {
  const bool held = chip_.reset_held != config_.pins.reset.inverted;
  pulse::PinSequence sequence;
  sequence.add(lines_.reset, held, config_.timing.reset_low_ns);
  sequence.add(lines_.reset, !held, config_.timing.reset_wait_ns);
  return sequence;
}

pulse::PinSequence ChipPins::mode(int from_microsteps, int to_microsteps) const {
  const std::array<const Pin*, 3> pins = {&config_.pins.ms1, &config_.pins.ms2, &config_.pins.ms3};
  pulse::PinSequence sequence;
  chip::ModeCode code = *chip::codeOf(chip_, from_microsteps);
  for (const chip::ModeCode& next : chip::modePath(chip_, from_microsteps, to_microsteps)) {
    for (std::size_t i = 0; i < pins.size(); ++i) {
      if (next[i] == code[i]) continue;
      sequence.add(lines_.mode[i], next[i] != pins[i]->inverted, config_.timing.mode_setup_ns);
    }
    code = next;
  }
  return sequence;
}

pulse::PinSequence ChipPins::restore(bool enabled, bool asleep) const {
  pulse::PinSequence sequence;
  sequence.add(lines_.step, chip_.step_active == config_.pins.step.inverted,
               config_.timing.step_low_ns);
  const auto append = [&sequence](const pulse::PinSequence& part) {
    const auto& last = part.writes[part.size - 1];
    sequence.add(last.line, last.level, last.then_wait);
  };
  if (hasSleep()) append(sleep(asleep));
  if (hasReset()) append(reset());
  if (hasEnable()) append(enable(enabled));
  return sequence;
}

}  // namespace stepdriver::axis
