#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "sim_time.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

enum class Pin { kStep, kDir, kEnable, kMs1, kMs2, kMs3, kSleep, kReset, kIn1, kIn2, kIn3, kIn4 };
constexpr std::size_t kPinCount = 12;

/// The name of a pin in traces.
const char* nameOf(const RigAxisSpec& spec, Pin pin);
/// The level of its line that is a pulse on STEP, CW or CCW, and forward on DIR; nothing for
/// others.
std::optional<bool> activeLevel(const RigAxisSpec& spec, Pin pin);
const Wire& wireOf(const RigAxisSpec& spec, Pin pin);

/// A driver chip: pins in, translator out. It knows the times of all edges and counts violations of
/// the datasheet. Its input levels are those of the lines.
class ChipModel {
 public:
  /// A pulse: the direction of DIR, and the resulting step of the translator.
  struct Pulse {
    bool forward;
    std::int64_t moved;  ///< microsteps of the finest mode; 0 if the chip ignored it
  };

  explicit ChipModel(const RigAxisSpec& spec);

  /// The pin's line is driven with this level from now on.
  std::optional<Pulse> request(Pin pin, bool line_level, std::int64_t time_ns);

  /// The pin's line changed to this level.
  std::optional<Pulse> edge(Pin pin, bool line_level, std::int64_t time_ns);

  /// A write has ended: the coils that lines switch have their new current.
  std::optional<Pulse> coilsWritten(std::int64_t time_ns);
  /// The line of the pin was released.
  void released(Pin pin);

  /// The level of the pin's line.
  bool lineLevel(Pin pin) const { return at(pin).level != at(pin).inverted; }
  /// The level of a pin as the chip sees it.
  bool level(Pin pin) const { return at(pin).level; }
  bool energized() const { return enabled() && awake() && !inReset() && outputs_on_; }
  /// What registers, and not pins, say from now on.
  struct Configured {
    int microsteps = 1;
    bool outputs_on = false;
    bool both_edges = false;  ///< of STEP are steps
  };
  void configure(const Configured& registers);
  /// The host writes them, and they are about to be configured: its time is judged as that of the
  /// pins. A chip that loses its power changes them by itself.
  void checkWrite(const Configured& registers, std::int64_t time_ns);
  /// What ends a latched fault has happened.
  bool endsFault() const {
    if (chip_.fault_end == driver::FaultEnd::kReset) return inReset();
    return chip_.fault_end == driver::FaultEnd::kEnable && !enabled();
  }
  /// Its power was off, and is there again.
  void powerUp();
  /// It misses so many of the next pulses, then counts so many twice.
  void mishear(int missed, int doubled) {
    missed_ = missed;
    doubled_ = doubled;
  }
  bool inReset() const { return chip_.reset_held && at(Pin::kReset).level == *chip_.reset_held; }
  std::int64_t translator() const { return translator_; }
  int microsteps() const { return microsteps_; }
  int finest() const { return finest_; }
  std::int64_t cycle() const { return std::int64_t{driver::kFullStepsPerCycle} * finest_; }
  const std::map<Violation, std::int64_t>& violations() const { return violations_; }
  void count(Violation violation) { ++violations_[violation]; }

 private:
  struct PinState {
    bool inverted = false;
    bool level = false;   // as the chip sees it
    bool driven = false;  // was requested once
    std::int64_t changed_ns = kForEver;
  };

  PinState& at(Pin pin) { return pins_[static_cast<std::size_t>(pin)]; }
  const PinState& at(Pin pin) const { return pins_[static_cast<std::size_t>(pin)]; }
  bool hasPhases() const { return chip_.step_inputs == driver::StepInputs::kPhases; }
  bool enabled() const {
    return hasPhases() ? coils_ != 0 : at(Pin::kEnable).level == chip_.enable_on;
  }
  driver::CoilSet wantedCoils() const;
  bool awake() const { return !chip_.sleep_asleep || at(Pin::kSleep).level != *chip_.sleep_asleep; }
  /// It takes STEP into account, whether current flows or not.
  bool counts() const;
  /// Its pins, or its state without current, keep the translator at Home.
  bool isHeldAtHome() const;

  bool idleLevel(Pin pin, bool wired, const driver::ModeCode& straps) const;
  std::optional<int> decodedMicrosteps() const;
  void decode() { decoded_ = decodedMicrosteps(); }
  void checkTime(std::int64_t since_ns, std::int64_t time_ns, std::int64_t limit_ns,
                 Violation violation);
  bool isCwCcw() const { return chip_.step_inputs == driver::StepInputs::kCwCcw; }
  std::optional<Pulse> onStep(Pin pin, std::int64_t time_ns);
  void checkPins(Pin pin, std::int64_t time_ns);
  void checkGap(Pin pin, std::int64_t time_ns);
  void checkTurn(Pin pin, std::int64_t time_ns);
  void checkReadiness(std::int64_t time_ns);
  void onMode(std::int64_t time_ns);
  std::int64_t advance(bool forward);
  int heard();
  void goHomeIfHeld();

  const driver::DriverChip chip_;
  const int finest_;
  const int declared_microsteps_;
  const bool decodes_;  // a microstep pin is wired
  std::array<PinState, kPinCount> pins_;
  Pin last_step_ = Pin::kStep;  // the pin of the last active edge
  std::int64_t step_active_ns_ = kForEver;
  std::int64_t step_inactive_ns_ = kForEver;
  std::int64_t mode_changed_ns_ = kForEver;
  std::int64_t translator_ = 0;
  std::optional<int> decoded_;  // mode selected by the microstep pins, or by registers
  bool by_registers_ = false;
  bool outputs_on_ = true;
  bool both_edges_;
  int microsteps_;
  driver::CoilSet coils_ = 0;      // those that have current
  bool pattern_is_known_ = false;  // since the lines were requested
  std::int64_t coils_on_ns_ = kForEver;
  const bool keeps_coils_;
  int missed_ = 0;
  int doubled_ = 0;
  std::map<Violation, std::int64_t> violations_;
};

}  // namespace stepdriver::sim
