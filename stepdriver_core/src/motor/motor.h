#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "brake.h"
#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "driver_pins.h"
#include "motion_history.h"
#include "motions.h"
#include "motor_lines.h"
#include "power.h"
#include "profile/input_shaper.h"
#include "profile/shaped_profile.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "tmc_chip.h"
#include "translator.h"

namespace stepdriver::motor {

/// The motor of an axis, or several that step together, or one of those that it shares with other
/// axes: their driver chips and their channel of the
/// pulse engine, as the controller knows them. It counts in microsteps and doesn't know the scale
/// of the axis.
class Motor {
 public:
  /// @param config outlives the motor.
  Motor(const config::AxisConfig& config, const MotorLines& lines, int channel);

  int channel() const { return channel_; }
  const MotorLines& lines() const { return lines_; }
  const DriverPins& pins() const { return pins_; }

  /// The engine's last report on the channel.
  const pulse::ChannelState& state() const { return state_; }
  void update(const pulse::ChannelState& state);

  bool moving() const { return motions_.moving(); }
  const Motions& motions() const { return motions_; }
  void ordered(Motion motion) { motions_.add(std::move(motion)); }
  /// The serial of a new order to the engine.
  std::uint64_t nextSerial() { return ++serial_; }

  /// A plan with its shaper, to be ordered next: it takes over from the motion that was ordered
  /// last, or begins at rest.
  motion::PlannedMotion shaped(motion::Profile plan) const;

  /// [microsteps] The planned state of the motor at a motion time: what a plan begins from. With a
  /// shaper, the motor itself is still on its way there.
  motion::MotionState stateAt(std::int64_t at) const;

  Power& power() { return power_; }
  const Power& power() const { return power_; }
  Brake& brake() { return brake_; }
  const Brake& brake() const { return brake_; }
  /// The count of one of the motors.
  std::int64_t countOf(std::size_t motor) const {
    return is_shared_ ? state_.own : state_.count + state_.lags.at(motor);
  }

  /// @name Where it was, see MotionHistory
  /// @{
  void watchMotions();
  void unwatchMotions() { history_.unwatch(); }
  const MotionHistory& history() const { return history_; }
  /// @}

  /// @name The translators
  /// @{
  /// That of an axis with one motor: only such a one changes its mode.
  Translator& translator() { return translators_.front(); }
  const Translator& translator() const { return translators_.front(); }
  int microsteps() const { return translators_.front().microsteps(); }
  bool isAtHome(std::size_t motor) const;
  /// Whether each translator is at Home.
  bool areAtHome() const;
  /// That of a motor has gone Home.
  void wentHome(std::size_t motor) { translators_.at(motor).wentHome(countOf(motor)); }
  /// @}

  /// @name Chips with a serial port
  /// @{
  /// That of a motor; nullptr: it has none.
  TmcChip* tmcAt(std::size_t motor) { return tmcs_.at(motor).get(); }
  const TmcChip* tmcAt(std::size_t motor) const { return tmcs_.at(motor).get(); }
  std::size_t chips() const { return tmcs_.size(); }
  /// The chip of a motor is set up: its place in the electrical cycle is known.
  void alignTranslator(std::size_t motor);
  /// What they have told, for readers; nullptr if there is none. @pre noteChips() after each change
  const std::shared_ptr<const std::vector<driver::DriverState>>& driverStates() const {
    return driver_states_;
  }
  void noteChips();
  /// [1/256 full step] MSCNT of the chip of a motor at its present count, or where the pattern of
  /// its coils is; empty: it isn't known.
  std::optional<int> mscntOf(std::size_t motor) const;
  /// All of them have lost their registers.
  void forgetRegisters();
  /// @}

  /// @name Coils that are switched by lines
  /// @{
  /// All motors of an axis have them, or no motor.
  bool hasCoils() const { return lines_.hasCoils(); }
  /// Their current, at the present counts. @pre There are such coils.
  pulse::CoilCurrent coilCurrent(bool on) const;
  /// The pattern of a motor's coils continues from here: from a place that its mode has.
  void continueCoils(std::size_t motor, int mscnt);
  /// @}

  /// @name Motors that step together
  /// @{
  pulse::MotorSet allMotors() const;
  /// [microsteps] How far they have got apart since they were square.
  std::int64_t skew() const { return pulse::skewOf(state_.lags, square_lags_, lines_.motors()); }
  /// Their lags when they were square.
  const pulse::MotorCounts& squareLags() const { return square_lags_; }
  /// They are square now: each at the place of the others.
  void noteSquare() { square_lags_ = state_.lags; }
  /// @}

  /// @name ENABLE, which several axes may share
  /// @{
  /// Whether all its lines stay asserted if this axis releases them.
  bool enableIsHeldByOthers() const;
  /// Lines that another axis holds are not written.
  PinSequence enable(bool on) const;
  /// Writes STEP and all other pins but those of the microstep mode, see DriverPins::restore().
  PinSequence restore() const;
  void noteEnable(bool wanted);
  /// @return whether a shared line was released since the last call: nothing held the motor then.
  bool takeReleases();
  /// @}

  /// A write of a pin has failed: the levels of the pins are unknown.
  bool pinsAreDoubtful() const { return pins_doubtful_; }
  void doubtPins() { pins_doubtful_ = true; }
  /// A change of the mode whose pins could not all be written.
  void modeFailed(int wanted) { mode_failed_ = wanted; }
  int failedMode() const { return mode_failed_; }
  void pinsRestored();

 private:
  MotionHistory::Part restingPart() const;
  void remember(const pulse::ChannelState& before);

  /// An ENABLE line, and the part of this axis in it.
  struct EnableShare {
    int line = -1;
    std::shared_ptr<EnableLine> shared;
    std::size_t number = 0;  // the number of this axis there
    std::uint64_t releases_seen = 0;
  };

  bool isHeldByOthers(int enable_line) const;

  const int channel_;
  const MotorLines lines_;
  const bool is_shared_;
  const DriverPins pins_;
  const std::shared_ptr<const motion::InputShaper> shaper_;
  pulse::ChannelState state_;
  Motions motions_;
  MotionHistory history_;
  std::uint64_t serial_ = 0;
  Power power_;
  Brake brake_;
  std::vector<Translator> translators_;         // by motor
  std::vector<std::unique_ptr<TmcChip>> tmcs_;  // by motor
  std::shared_ptr<const std::vector<driver::DriverState>> driver_states_;
  std::vector<EnableShare> enables_;
  pulse::MotorCounts square_lags_{};
  bool pins_doubtful_ = false;
  int mode_failed_ = 0;
};

}  // namespace stepdriver::motor
