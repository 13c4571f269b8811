#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::axis {

/// One axis of a machine::Machine, which makes it: units in, pulses out.
///
/// All calls are safe from any thread. They are carried out in the order in which they come, with
/// those of all other axes. Every command is either accepted whole or throws Refused and changes
/// nothing. A unit is m on a linear axis, rad on a rotary one.
class Axis {
 public:
  Axis() = default;
  virtual ~Axis() = default;
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  /// As configured; what setLimits() and setMicrosteps() change is in limits() and state().
  virtual const config::AxisConfig& config() const = 0;

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
  ///   at fault, or the machine shuts down; an absolute position also where the axis isn't homed,
  ///   but has to be.
  virtual Move moveTo(double position, bool relative = false, double velocity = 0.0) = 0;

  /// What moveTo() would do now; nothing moves.
  ///
  /// @throw Refused as moveTo().
  virtual MovePlan plan(double position, bool relative = false, double velocity = 0.0) = 0;

  /// Turns the motor by a number of rounds, which need not be whole.
  ///
  /// @throw Refused as moveTo(), and where the steps of a round are not known.
  virtual Move moveRounds(double rounds, double velocity = 0.0) = 0;

  /// How a move ended, however long ago; none if it hasn't.
  virtual std::optional<MoveResult> result(const Move& move) const = 0;

  /// Returns when the move has ended. @throw Refused for a move of plan().
  virtual MoveResult wait(const Move& move) = 0;

  /// Moves on at a velocity until it is told otherwise, or up to the soft limit, where it rests; 0
  /// ends a jog. A motion under way is replaced. To call it again with the same velocity changes
  /// nothing.
  ///
  /// @param velocity [unit/s] negative: towards min.
  /// @param unless_stopped_since AxisState::stops as it was when the stream of jogs began that this
  ///   one belongs to: a stream does not run on through a stop, a hold, a disable or a recover.
  /// @throw Refused as moveTo(), and if the axis rests at the soft limit ahead, or has been stopped
  ///   since.
  virtual void jog(double velocity, std::optional<std::uint64_t> unless_stopped_since = {}) = 0;

  /// Changes what motions keep to, within what is configured. A lower max_speed slows down a move
  /// or a jog under way at once; axes that move together keep what they began with. Another
  /// acceleration, deceleration or jerk holds for motions that begin at rest: one under way is
  /// planned to come to rest by the old ones, and might not do so in time by the new ones.
  ///
  /// @param wanted 0: as configured.
  /// @throw Refused where one isn't a number from 0 to what is configured, or to any where no jerk
  ///   limit is; then nothing changes.
  virtual void setLimits(const AxisLimits& wanted) = 0;

  /// For motions that begin at rest.
  virtual AxisLimits limits() const = 0;

  /// Decelerates to rest, and returns when the deceleration has been handed to the pulse thread.
  /// The axes that move together with this one stop with it, along their path. What is held is
  /// given up. Without effect else at rest.
  virtual void stop() = 0;

  /// The same where the axis still makes this move, or holds it: what has replaced it goes on.
  virtual void stop(const Move& move) = 0;

  /// Finds the axis's zero by its switch, as AxisConfig::homing says, and returns when that is
  /// over. Soft limits don't count meanwhile. Where it fails, the axis stands, enabled as before,
  /// and isn't homed: the result says why. Stops end it; other motions take over from it.
  ///
  /// @param cancelled asked often, from the calling thread: true decelerates and ends it.
  /// @throw Refused where homing isn't configured, while moving, and as moveTo().
  virtual HomingResult home(const std::function<bool()>& cancelled = {}) = 0;

  /// @throw Refused where home() would be, now.
  virtual void checkHoming() const = 0;

  /// Energizes the motor, or takes its current away; a motion under way is stopped first. Disabling
  /// ends the trust in the position, but with AxisConfig::holds_position_unpowered: nothing holds
  /// the motor.
  ///
  /// @throw Refused where the axis is at fault (enabling only), or enable isn't wired.
  virtual void enable(bool on) = 0;

  /// Puts the chip to sleep, or wakes it: at Home, so that the position is trusted only where that
  /// was its phase and AxisConfig::holds_position_unpowered is set. @throw Refused while moving,
  /// and where SLEEP isn't wired.
  virtual void sleep(bool asleep) = 0;

  /// Pulses RESET: the translator goes to Home. @throw Refused while moving, and where RESET isn't
  /// wired.
  virtual void reset() = 0;

  /// Changes the microstep mode and keeps the position; steps per unit follow. Where the new mode
  /// has no place at this position it is refused, or, with AxisConfig::align_on_microstep_change,
  /// the axis moves to the nearest common one first (the call then waits for that).
  ///
  /// @throw Refused while moving, for a mode that the chip doesn't have or whose pins aren't wired,
  ///   and for chips whose mode is set by switches.
  virtual void setMicrosteps(int microsteps) = 0;

  /// Declares where the axis stands; the position is trusted from then on. Nothing moves.
  ///
  /// @throw Refused while moving, where the number isn't finite or is beyond a soft limit.
  virtual void setPosition(double position) = 0;

  /// What the axis is and does now, whole and from one instant.
  virtual AxisState state() const = 0;

  /// [microsteps/s] The highest rate of the motion under way, as planned; 0 at rest.
  virtual double peakRate() const = 0;

  /// @throw GpioError where a line can't be read.
  virtual EndstopState endstops() const = 0;
};

}  // namespace stepdriver::axis
