#pragma once

#include <cstddef>
#include <cstdint>

#include "brake.h"
#include "driver_pins.h"
#include "motion/profile.h"
#include "motions.h"
#include "motor_lines.h"
#include "power.h"
#include "pulse/channel.h"
#include "stepdriver_core/config/axis_config.h"
#include "translator.h"

namespace stepdriver::motor {

/// One driver chip and its channel of the pulse engine, as the controller knows them. It counts in
/// microsteps and doesn't know the scale of the axis.
class Motor {
 public:
  /// @param config outlives the motor.
  Motor(const config::AxisConfig& config, const MotorLines& lines, int channel);

  int channel() const { return channel_; }
  const MotorLines& lines() const { return lines_; }
  const DriverPins& pins() const { return pins_; }

  /// The engine's last report on the channel.
  const pulse::ChannelState& state() const { return state_; }
  void take(const pulse::ChannelState& state);

  bool moving() const { return motions_.moving(); }
  const Motions& motions() const { return motions_; }
  void ordered(Motion motion) { motions_.add(std::move(motion)); }
  /// The serial of a new order to the engine.
  std::uint64_t nextSerial() { return ++serial_; }

  /// [microsteps] The state of the motor at a motion time.
  motion::MotionState stateAt(std::int64_t at) const;

  Power& power() { return power_; }
  const Power& power() const { return power_; }
  Brake& brake() { return brake_; }
  const Brake& brake() const { return brake_; }
  Translator& translator() { return translator_; }
  const Translator& translator() const { return translator_; }
  int microsteps() const { return translator_.microsteps(); }

  /// @name ENABLE, which several motors may share
  /// @{
  bool enableIsHeldByOthers() const;
  void noteEnable(bool wanted);
  /// @return whether the shared line was released since the last call: nothing held the motor then.
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
  const int channel_;
  const MotorLines lines_;
  const DriverPins pins_;
  pulse::ChannelState state_;
  Motions motions_;
  std::uint64_t serial_ = 0;
  Power power_;
  Brake brake_;
  Translator translator_;
  std::size_t on_enable_line_ = 0;  // its number there
  std::uint64_t releases_seen_ = 0;
  bool pins_doubtful_ = false;
  int mode_failed_ = 0;
};

}  // namespace stepdriver::motor
