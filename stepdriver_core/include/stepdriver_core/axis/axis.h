#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::gpio {
class Lines;
}

namespace stepdriver::pulse {
class PulseDriver;
}

namespace stepdriver::axis {

struct AxisLines;

/// One axis: units in, pulses out. Made by the Machine that it belongs to.
///
/// All calls are safe from any thread, and none of them but wait() takes longer than the chip does
/// to wake, to be reset or to be enabled. Every command either is accepted whole or throws Refused
/// and changes nothing. A unit is m on a linear axis, rad on a rotary one.
class Axis {
 public:
  /// @param channel of the engine, as made from lines.
  /// @param lines, driver outlive the axis.
  Axis(AxisConfig config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
       pulse::PulseDriver& driver);
  ~Axis();
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  const AxisConfig& config() const;

  /// Moves to a position and rests there. A motion under way is replaced: the axis goes on from the
  /// speed and the acceleration that it has, and whoever waits for the earlier move is told. It
  /// doesn't pass its target, but where it can't stop before it; then it comes back, and
  /// Move::overshoot says how far it goes.
  ///
  /// @param position [unit] absolute, or, where `relative`, from where the axis stands; while it
  ///   moves, from where that motion would have ended.
  /// @param velocity [unit/s] highest speed on the way; 0: the axis's maximum.
  /// @throw Refused where a number isn't finite, the target is beyond a soft limit, the velocity
  ///   beyond the axis's maximum, the endstop on the way is active, the axis is disabled, asleep or
  ///   at fault, or the machine shuts down.
  Move moveTo(double position, bool relative = false, double velocity = 0.0);

  /// Turns the motor by a number of rounds, which need not be whole.
  ///
  /// @throw Refused as moveTo(), and where the steps of a round are not known.
  Move moveRounds(double rounds, double velocity = 0.0);

  /// Returns when the move has ended.
  MoveResult wait(const Move& move);

  /// Moves on at a velocity until it is told otherwise, or up to the soft limit, where it rests; 0
  /// ends a jog. A motion under way is replaced. To call it again with the same velocity changes
  /// nothing.
  ///
  /// @param velocity [unit/s] negative: towards min.
  /// @throw Refused as moveTo(), and where the axis rests at the soft limit ahead.
  void jog(double velocity);

  /// Scales the velocities of all motions, of one under way too; never beyond the axis's maximum.
  ///
  /// @param factor above 0.
  void setSpeedOverride(double factor);

  /// Decelerates to rest, and returns when the deceleration has been handed to the pulse thread.
  /// Without effect at rest.
  void stop();

  /// Energizes the motor, or takes its current away; a motion under way is stopped first. Disabling
  /// ends the trust in the position, but with AxisConfig::holds_position_unpowered: nothing holds
  /// the motor.
  ///
  /// @throw Refused where the axis is at fault (enabling only), or enable isn't wired.
  void enable(bool on);

  /// Puts the chip to sleep, or wakes it: at Home, so that the position is trusted only where that
  /// was its phase and AxisConfig::holds_position_unpowered is set. @throw Refused while moving,
  /// and where SLEEP isn't wired.
  void sleep(bool asleep);

  /// Pulses RESET: the translator goes to Home. @throw Refused while moving, and where RESET isn't
  /// wired.
  void reset();

  /// Changes the microstep mode and keeps the position; steps per unit follow. Where the new mode
  /// has no place at this position it is refused, or, with AxisConfig::align_on_microstep_change,
  /// the axis moves to the nearest common one first (the call then waits for that).
  ///
  /// @throw Refused while moving, for a mode that the chip doesn't have or whose pins aren't wired,
  ///   and for chips whose mode is set by switches.
  void setMicrosteps(int microsteps);

  /// Declares where the axis stands; the position is trusted from then on. Nothing moves.
  ///
  /// @throw Refused while moving, where the number isn't finite or is beyond a soft limit.
  void setPosition(double position);

  AxisState state() const;

  /// @throw GpioError where a line can't be read.
  EndstopState endstops() const;

  // What follows is the machine's side.

  /// Wakes the chip, ends its reset, and enables it where the configuration says so and the
  /// emergency-stop input isn't active.
  /// @throw GpioError
  void bringUp();

  /// Takes the motor's current away where the axis has stood for its idle time-out. Where the pin
  /// can't be written the axis has the fault that says so.
  ///
  /// @return the clock time at which it wants to be called again, at the latest.
  pulse::Nanoseconds supervise();

  /// Ends a latched fault; the axis stands as it is. A chip with a fault line is reset for that,
  /// where RESET is wired.
  ///
  /// @throw GpioError where a line still fails. @throw Refused where the chip still reports a
  /// fault, or an emergency stop has come since the engine was told that the last one is over.
  void recover();

  /// Latches the fault of an emergency stop that the engine has been told of.
  void noteEmergencyStop();

  /// Refuses every command from now on, with this reason, and decelerates to rest.
  void close(const std::string& reason);

  /// After close(): waits for the rest, and disables where the configuration says so.
  void shutDown();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::axis
