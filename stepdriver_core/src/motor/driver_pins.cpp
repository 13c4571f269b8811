#include "driver_pins.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace stepdriver::motor {
namespace {

/// The writes to the pins of one chip.
class ChipPins {
 public:
  ChipPins(const config::AxisConfig& config, const MotorLines& lines, std::size_t motor)
      : chip_(config.motorAt(motor).driver),
        pins_(config.motorAt(motor).pins),
        lines_(lines.motorAt(motor)),
        cw_ccw_(lines.cw_ccw) {}

  PinSequence bringUp() const {
    const driver::Timing& timing = chip_.timing;
    PinSequence sequence;
    if (hasSleep()) sequence.add(lines_.sleep, sleepLevel(false), hasReset() ? 0 : timing.wake_ns);
    if (hasReset()) {
      sequence.add(lines_.reset, resetLevel(true), timing.reset_low_ns);
      sequence.add(
          lines_.reset, resetLevel(false),
          hasSleep() ? std::max(timing.wake_ns, timing.reset_wait_ns) : timing.reset_wait_ns);
    }
    return sequence;
  }

  PinSequence enable(bool on) const {
    const bool level = (chip_.enable_on == on) != pins_.enable.inverted;
    PinSequence sequence;
    if (lines_.enable >= 0) sequence.add(lines_.enable, level, on ? chip_.timing.enable_ns : 0);
    return sequence;
  }

  PinSequence sleep(bool asleep) const {
    PinSequence sequence;
    sequence.add(lines_.sleep, sleepLevel(asleep), asleep ? 0 : chip_.timing.wake_ns);
    return sequence;
  }

  PinSequence reset() const {
    PinSequence sequence;
    if (!hasReset()) return sequence;
    sequence.add(lines_.reset, resetLevel(true), chip_.timing.reset_low_ns);
    sequence.add(lines_.reset, resetLevel(false), chip_.timing.reset_wait_ns);
    return sequence;
  }

  PinSequence mode(int from_microsteps, int to_microsteps) const {
    const std::array<const config::Pin*, 3> pins = {&pins_.ms1, &pins_.ms2, &pins_.ms3};
    PinSequence sequence;
    driver::ModeCode code = *driver::codeOf(chip_, from_microsteps);
    for (const driver::ModeCode& next : driver::modePath(chip_, from_microsteps, to_microsteps)) {
      for (std::size_t i = 0; i < pins.size(); ++i) {
        if (next[i] == code[i]) continue;
        sequence.add(lines_.mode[i], next[i] != pins[i]->inverted, chip_.timing.mode_setup_ns);
      }
      code = next;
    }
    return sequence;
  }

  PinSequence restore(bool enabled, bool asleep) const {
    PinSequence sequence;
    const auto end_pulse = [&](int line, const config::Pin& pin) {
      sequence.add(line, chip_.step_active == pin.inverted, chip_.timing.step_low_ns);
    };
    // If each edge is a step, the line has no level to go back to.
    if (!chip_.both_edges) end_pulse(lines_.step, pins_.step);
    if (cw_ccw_) end_pulse(lines_.dir, pins_.dir);
    if (hasSleep()) sequence.append(sleep(asleep));
    if (hasReset()) sequence.add(lines_.reset, resetLevel(false), chip_.timing.reset_wait_ns);
    if (lines_.enable >= 0) sequence.append(enable(enabled));
    return sequence;
  }

 private:
  bool hasSleep() const { return lines_.sleep >= 0; }
  bool hasReset() const { return lines_.reset >= 0; }
  bool sleepLevel(bool asleep) const {
    return (chip_.sleep_asleep.value_or(false) == asleep) != pins_.sleep.inverted;
  }
  bool resetLevel(bool held) const {
    return (chip_.reset_held.value_or(false) == held) != pins_.reset.inverted;
  }

  const driver::DriverChip& chip_;
  const config::Pins& pins_;
  const ChipLines& lines_;
  const bool cw_ccw_;
};

/// The sequences of all chips of an axis, write by write: after those that are made together, the
/// longest of their waits passes. Each line is written once at a time: the motors may share that of
/// ENABLE.
template <typename SequenceOf>
PinSequence together(const config::AxisConfig& config, const MotorLines& lines,
                     const SequenceOf& sequence_of) {
  std::vector<PinSequence> parts;
  std::size_t longest = 0;
  for (std::size_t i = 0; i < config.motors(); ++i) {
    parts.push_back(sequence_of(ChipPins(config, lines, i), lines.motorAt(i)));
    longest = std::max(longest, parts.back().size);
  }
  PinSequence all;
  for (std::size_t k = 0; k < longest; ++k) {
    const std::size_t first = all.size;
    pulse::Nanoseconds wait = 0;
    for (const PinSequence& part : parts) {
      if (k >= part.size) continue;
      const PinSequence::Write& write = part.writes.at(k);
      wait = std::max(wait, write.then_wait);
      const bool is_written =
          std::any_of(all.writes.begin() + first, all.writes.begin() + all.size,
                      [&](const PinSequence::Write& other) { return other.line == write.line; });
      if (!is_written) all.add(write.line, write.level, 0);
    }
    all.writes.at(all.size - 1).then_wait = wait;
  }
  return all;
}

}  // namespace

DriverPins::DriverPins(const config::AxisConfig& config, const MotorLines& lines)
    : config_(config), lines_(lines) {}

bool DriverPins::hasReset() const {
  for (std::size_t i = 0; i < lines_.motors(); ++i) {
    if (lines_.motorAt(i).reset >= 0) return true;
  }
  return false;
}

PinSequence DriverPins::bringUp() const {
  return together(config_, lines_,
                  [](const ChipPins& chip, const ChipLines&) { return chip.bringUp(); });
}

PinSequence DriverPins::enable(bool on, const Lines& written) const {
  const PinSequence all = together(
      config_, lines_, [on](const ChipPins& chip, const ChipLines&) { return chip.enable(on); });
  PinSequence sequence;
  for (std::size_t i = 0; i < all.size; ++i) {
    if (written(all.writes.at(i).line))
      sequence.add(all.writes.at(i).line, all.writes.at(i).level, 0);
  }
  if (sequence.size > 0) {
    sequence.writes.at(sequence.size - 1).then_wait = all.writes.at(all.size - 1).then_wait;
  }
  return sequence;
}

PinSequence DriverPins::sleep(bool asleep) const {
  return together(config_, lines_,
                  [asleep](const ChipPins& chip, const ChipLines&) { return chip.sleep(asleep); });
}

PinSequence DriverPins::reset() const {
  return together(config_, lines_,
                  [](const ChipPins& chip, const ChipLines&) { return chip.reset(); });
}

PinSequence DriverPins::mode(int from_microsteps, int to_microsteps) const {
  return together(config_, lines_, [=](const ChipPins& chip, const ChipLines&) {
    return chip.mode(from_microsteps, to_microsteps);
  });
}

PinSequence DriverPins::restore(const Lines& enabled, bool asleep) const {
  return together(config_, lines_, [&](const ChipPins& chip, const ChipLines& lines) {
    return chip.restore(enabled(lines.enable), asleep);
  });
}

}  // namespace stepdriver::motor
