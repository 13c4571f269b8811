#include "chip_model.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <utility>

namespace stepdriver::sim {
namespace {

constexpr std::array<const char*, kPinCount> kPinNames{
    "step", "dir", "enable", "ms1", "ms2", "ms3", "sleep", "reset", "in1", "in2", "in3", "in4"};
constexpr std::array<Wire RigAxisSpec::*, kPinCount> kWires{
    &RigAxisSpec::step, &RigAxisSpec::dir, &RigAxisSpec::enable, &RigAxisSpec::ms1,
    &RigAxisSpec::ms2,  &RigAxisSpec::ms3, &RigAxisSpec::sleep,  &RigAxisSpec::reset,
    &RigAxisSpec::in1,  &RigAxisSpec::in2, &RigAxisSpec::in3,    &RigAxisSpec::in4};
constexpr std::array<Pin, driver::kCoils> kCoilPins{Pin::kIn1, Pin::kIn2, Pin::kIn3, Pin::kIn4};

bool isCoilPin(Pin pin) {
  return std::find(kCoilPins.begin(), kCoilPins.end(), pin) != kCoilPins.end();
}

/// Each mode's microstep is a whole number of the finest one's.
int finestOf(const RigAxisSpec& spec) {
  int finest = spec.microsteps;
  for (const int microsteps : spec.chip.microsteps) finest = std::lcm(finest, microsteps);
  return finest;
}

bool wiresModePins(const RigAxisSpec& spec) {
  return !spec.ms1.line.empty() || !spec.ms2.line.empty() || !spec.ms3.line.empty();
}

std::int64_t floorDivide(std::int64_t dividend, std::int64_t divisor) {
  const std::int64_t quotient = dividend / divisor;
  return dividend % divisor < 0 ? quotient - 1 : quotient;
}

}  // namespace

const char* nameOf(const RigAxisSpec& spec, Pin pin) {
  if (spec.chip.step_inputs == driver::StepInputs::kCwCcw) {
    if (pin == Pin::kStep) return "cw";
    if (pin == Pin::kDir) return "ccw";
  }
  return kPinNames[static_cast<std::size_t>(pin)];
}

std::optional<bool> activeLevel(const RigAxisSpec& spec, Pin pin) {
  if (pin != Pin::kStep && pin != Pin::kDir) return {};
  const bool pulses = pin == Pin::kStep || spec.chip.step_inputs == driver::StepInputs::kCwCcw;
  return (!pulses || spec.chip.step_active) != wireOf(spec, pin).inverted;
}

const Wire& wireOf(const RigAxisSpec& spec, Pin pin) {
  return spec.*kWires[static_cast<std::size_t>(pin)];
}

ChipModel::ChipModel(const RigAxisSpec& spec)
    : chip_(spec.chip),
      finest_(finestOf(spec)),
      declared_microsteps_(spec.microsteps),
      decodes_(!chip_.modes.empty() && wiresModePins(spec)),
      both_edges_(chip_.both_edges),
      microsteps_(spec.microsteps),
      keeps_coils_(spec.keeps_coils) {
  const driver::ModeCode straps =
      driver::codeOf(chip_, spec.microsteps).value_or(driver::ModeCode{});
  for (std::size_t i = 0; i < kPinCount; ++i) {
    const Pin pin = static_cast<Pin>(i);
    const Wire& wire = wireOf(spec, pin);
    pins_[i].inverted = wire.inverted;
    pins_[i].level = idleLevel(pin, !wire.line.empty(), straps);
  }
  decode();
}

bool ChipModel::idleLevel(Pin pin, bool wired, const driver::ModeCode& straps) const {
  switch (pin) {
    case Pin::kStep:
      return !chip_.step_active;
    case Pin::kDir:
      return isCwCcw() ? !chip_.step_active : !wired && at(pin).inverted;
    case Pin::kEnable:
      return wired ? !chip_.enable_on : chip_.enable_on;
    case Pin::kMs1:
      return !wired && straps[0];
    case Pin::kMs2:
      return !wired && straps[1];
    case Pin::kMs3:
      return !wired && straps[2];
    case Pin::kSleep:
      return wired == chip_.sleep_asleep.value_or(false);
    case Pin::kReset:
      return wired == chip_.reset_held.value_or(false);
    case Pin::kIn1:
    case Pin::kIn2:
    case Pin::kIn3:
    case Pin::kIn4:
      return false;
  }
  return false;
}

std::optional<ChipModel::Pulse> ChipModel::request(Pin pin, bool line_level, std::int64_t time_ns) {
  PinState& state = at(pin);
  if (isCoilPin(pin)) pattern_is_known_ = false;
  if (state.driven) return edge(pin, line_level, time_ns);
  state.driven = true;
  const bool level = line_level != state.inverted;
  const bool changes_state = pin == Pin::kEnable || pin == Pin::kSleep || pin == Pin::kReset;
  if (level != state.level && changes_state) state.changed_ns = time_ns;
  state.level = level;
  decode();
  return std::nullopt;
}

std::optional<ChipModel::Pulse> ChipModel::edge(Pin pin, bool line_level, std::int64_t time_ns) {
  PinState& state = at(pin);
  const bool level = line_level != state.inverted;
  if (level == state.level) return std::nullopt;
  state.level = level;
  state.changed_ns = time_ns;
  switch (pin) {
    case Pin::kStep:
      return onStep(pin, time_ns);
    case Pin::kDir:
      if (isCwCcw()) return onStep(pin, time_ns);
      checkTime(step_active_ns_, time_ns, chip_.timing.dir_hold_ns, Violation::kDirHold);
      break;
    case Pin::kMs1:
    case Pin::kMs2:
    case Pin::kMs3:
      onMode(time_ns);
      break;
    case Pin::kEnable:
    case Pin::kSleep:
    case Pin::kReset:
      goHomeIfHeld();
      break;
    case Pin::kIn1:
    case Pin::kIn2:
    case Pin::kIn3:
    case Pin::kIn4:
      break;  // coilsWritten() sees all of them
  }
  return std::nullopt;
}

driver::CoilSet ChipModel::wantedCoils() const {
  driver::CoilSet coils = 0;
  for (std::size_t i = 0; i < kCoilPins.size(); ++i) {
    if (at(kCoilPins[i]).level) coils |= static_cast<driver::CoilSet>(1U << i);
  }
  return coils;
}

std::optional<ChipModel::Pulse> ChipModel::coilsWritten(std::int64_t time_ns) {
  const driver::CoilSet before = std::exchange(coils_, wantedCoils());
  if (coils_ == before || coils_ == 0) return std::nullopt;
  constexpr auto kPlaces = static_cast<std::int64_t>(driver::kHalfSteps.size());
  const auto& patterns = driver::kHalfSteps;
  const auto found = std::find(patterns.begin(), patterns.end(), coils_);
  if (found == patterns.end()) {
    count(Violation::kUndefinedPattern);
    return std::nullopt;
  }
  const std::int64_t place = found - patterns.begin();
  const std::int64_t step = finest_ / microsteps_;
  if (place % step != 0) {
    count(Violation::kCoilLeftOn);
    return std::nullopt;
  }
  const std::int64_t ahead = place - translator_ + kPlaces / 2;
  const std::int64_t moved = ahead - kPlaces * floorDivide(ahead, kPlaces) - kPlaces / 2;
  translator_ += moved;
  const bool comes = before == 0;
  if (moved != 0 && (comes ? pattern_is_known_ : std::abs(moved) != step)) {
    count(Violation::kPatternJump);
  }
  pattern_is_known_ = true;
  if (comes) {
    coils_on_ns_ = time_ns;
    return std::nullopt;
  }
  if (moved == 0) return std::nullopt;
  checkTime(step_active_ns_, time_ns, chip_.timing.step_high_ns, Violation::kShortStepHigh);
  checkTime(coils_on_ns_, time_ns, chip_.timing.enable_ns, Violation::kStepAfterEnable);
  step_active_ns_ = time_ns;
  return Pulse{moved > 0, moved};
}

void ChipModel::released(Pin pin) {
  if (isCoilPin(pin) && at(pin).level && !keeps_coils_) count(Violation::kCoilLeftOn);
}

void ChipModel::checkTime(std::int64_t since_ns, std::int64_t time_ns, std::int64_t limit_ns,
                          Violation violation) {
  if (time_ns - since_ns < limit_ns) count(violation);
}

std::optional<ChipModel::Pulse> ChipModel::onStep(Pin pin, std::int64_t time_ns) {
  if (at(pin).level != chip_.step_active && !both_edges_) {
    checkTime(step_active_ns_, time_ns, chip_.timing.step_high_ns, Violation::kShortStepHigh);
    step_inactive_ns_ = time_ns;
    return std::nullopt;
  }
  checkPins(pin, time_ns);
  checkReadiness(time_ns);
  step_active_ns_ = time_ns;
  last_step_ = pin;

  Pulse pulse{isCwCcw() ? pin == Pin::kStep : at(Pin::kDir).level, 0};
  for (int i = heard(); i > 0 && counts(); --i) pulse.moved += advance(pulse.forward);
  return pulse;
}

// How often it counts a pulse.
int ChipModel::heard() {
  if (missed_ > 0) {
    --missed_;
    return 0;
  }
  if (doubled_ == 0) return 1;
  --doubled_;
  return 2;
}

void ChipModel::checkGap(Pin pin, std::int64_t time_ns) {
  if (!both_edges_) {
    return checkTime(step_inactive_ns_, time_ns, chip_.timing.step_low_ns,
                     Violation::kShortStepLow);
  }
  const bool was_active = at(pin).level != chip_.step_active;
  checkTime(step_active_ns_, time_ns,
            was_active ? chip_.timing.step_high_ns : chip_.timing.step_low_ns,
            was_active ? Violation::kShortStepHigh : Violation::kShortStepLow);
}

// The times of DIR are those between the pulses on the two inputs.
void ChipModel::checkTurn(Pin pin, std::int64_t time_ns) {
  const Pin other = pin == Pin::kStep ? Pin::kDir : Pin::kStep;
  if (at(other).level == chip_.step_active) count(Violation::kBothInputs);
  if (last_step_ != other) return;
  checkTime(step_inactive_ns_, time_ns, chip_.timing.dir_setup_ns, Violation::kDirSetup);
  checkTime(step_active_ns_, time_ns, chip_.timing.dir_hold_ns, Violation::kDirHold);
}

void ChipModel::checkPins(Pin pin, std::int64_t time_ns) {
  checkGap(pin, time_ns);
  if (isCwCcw()) {
    checkTurn(pin, time_ns);
  } else {
    checkTime(at(Pin::kDir).changed_ns, time_ns, chip_.timing.dir_setup_ns, Violation::kDirSetup);
  }
  checkTime(mode_changed_ns_, time_ns, chip_.timing.mode_setup_ns, Violation::kModeSetup);
  if (!decoded_) count(Violation::kUndefinedMode);
}

void ChipModel::checkReadiness(std::int64_t time_ns) {
  if (enabled()) {
    checkTime(at(Pin::kEnable).changed_ns, time_ns, chip_.timing.enable_ns,
              Violation::kStepAfterEnable);
  } else {
    count(Violation::kStepWhileDisabled);
  }
  if (!awake()) {
    count(Violation::kStepWhileAsleep);
  } else if (chip_.sleep_asleep) {
    checkTime(at(Pin::kSleep).changed_ns, time_ns, chip_.timing.wake_ns, Violation::kStepAfterWake);
  }
  if (inReset()) {
    count(Violation::kStepInReset);
  } else if (chip_.reset_held) {
    checkTime(at(Pin::kReset).changed_ns, time_ns, chip_.timing.reset_wait_ns,
              Violation::kStepInReset);
  }
}

void ChipModel::checkWrite(const Configured& registers, std::int64_t time_ns) {
  if (decoded_ == registers.microsteps) return;
  mode_changed_ns_ = time_ns;
  checkTime(step_active_ns_, time_ns, chip_.timing.mode_hold_ns, Violation::kModeHold);
}

void ChipModel::configure(const Configured& registers) {
  by_registers_ = true;
  decoded_ = registers.microsteps;
  outputs_on_ = registers.outputs_on;
  both_edges_ = registers.both_edges;
}

void ChipModel::onMode(std::int64_t time_ns) {
  if (!decodes_) return;
  decode();
  mode_changed_ns_ = time_ns;
  checkTime(step_active_ns_, time_ns, chip_.timing.mode_hold_ns, Violation::kModeHold);
  if (!decoded_) count(Violation::kUndefinedMode);
}

std::optional<int> ChipModel::decodedMicrosteps() const {
  if (by_registers_) return decoded_;
  if (!decodes_) return declared_microsteps_;
  return driver::microstepsOf(chip_,
                              {at(Pin::kMs1).level, at(Pin::kMs2).level, at(Pin::kMs3).level});
}

std::int64_t ChipModel::advance(bool forward) {
  // If the pins select an undefined mode, assume the previous one.
  microsteps_ = decoded_.value_or(microsteps_);
  const std::int64_t unit = finest_ / microsteps_;
  const std::int64_t before = translator_;
  if (by_registers_) {
    // Such a chip adds to its counter, wherever that is.
    translator_ += forward ? unit : -unit;
    return translator_ - before;
  }
  // From a position that a coarser mode doesn't have, it goes to the next one that the mode has.
  translator_ =
      forward ? (floorDivide(before, unit) + 1) * unit : -(floorDivide(-before, unit) + 1) * unit;
  return translator_ - before;
}

bool ChipModel::counts() const {
  if (inReset()) return false;
  if (!awake()) return chip_.asleep == driver::TranslatorState::kCounts;
  return enabled() || chip_.disabled == driver::TranslatorState::kCounts;
}

bool ChipModel::isHeldAtHome() const {
  if (inReset()) return true;
  if (!awake()) return chip_.asleep == driver::TranslatorState::kHome;
  return !enabled() && chip_.disabled == driver::TranslatorState::kHome;
}

void ChipModel::goHomeIfHeld() {
  if (isHeldAtHome()) powerUp();
}

void ChipModel::powerUp() {
  if (chip_.step_inputs == driver::StepInputs::kPhases) return;  // its lines are the pattern
  translator_ = cycle() * floorDivide(translator_ + cycle() / 2, cycle());
}

}  // namespace stepdriver::sim
