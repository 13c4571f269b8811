#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis_limits.h"
#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/axis/homing.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::gpio {
class Lines;
}

namespace stepdriver::pulse {
class PulseDriver;
}

namespace stepdriver::axis {

struct AxisLines;
class EdgeLog;

/// One axis: units in, pulses out. Made by the Machine that it belongs to.
///
/// All calls are safe from any thread, and none of them but wait() and home() takes longer than the
/// chip does to wake, to be reset or to be enabled. Every command either is accepted whole or
/// throws Refused and changes nothing. A unit is m on a linear axis, rad on a rotary one.
class Axis {
 public:
  class Impl;  ///< for this room only

  /// @param channel of the engine, as made from lines.
  /// @param lines, edges, driver, mutex outlive the axis. The mutex is that of all axes of a
  /// machine:
  ///   motions of several are planned under it.
  Axis(AxisConfig config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
       EdgeLog& edges, pulse::PulseDriver& driver, std::mutex& mutex);
  ~Axis();
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  /// As configured; what setLimits() and setMicrosteps() change is in limits() and state().
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
  ///   at fault, or the machine shuts down; an absolute position also where the axis isn't homed,
  ///   but has to be.
  Move moveTo(double position, bool relative = false, double velocity = 0.0);

  /// What moveTo() would do now; nothing moves.
  ///
  /// @throw Refused as moveTo().
  MovePlan plan(double position, bool relative = false, double velocity = 0.0);

  /// Turns the motor by a number of rounds, which need not be whole.
  ///
  /// @throw Refused as moveTo(), and where the steps of a round are not known.
  Move moveRounds(double rounds, double velocity = 0.0);

  /// How a move ended; none where it hasn't.
  std::optional<MoveResult> result(const Move& move) const;

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

  /// Changes what motions keep to, within what is configured. A lower max_speed slows down a move
  /// or a jog under way at once; axes that move together keep what they began with. Another
  /// acceleration, deceleration or jerk holds for motions that begin at rest: one under way is
  /// planned to come to rest by the old ones, and might not do so in time by the new ones.
  ///
  /// @param wanted 0: as configured.
  /// @throw Refused where one isn't a number from 0 to what is configured, or to any where no jerk
  ///   limit is; then nothing changes.
  void setLimits(const AxisLimits& wanted);

  /// For motions that begin at rest.
  AxisLimits limits() const;

  /// Decelerates to rest, and returns when the deceleration has been handed to the pulse thread.
  /// The axes that move together with this one stop with it, along their path. What is held is
  /// given up. Without effect else at rest.
  void stop();

  /// The same where the axis still makes this move, or holds it: what has replaced it goes on.
  void stop(const Move& move);

  /// Feed hold: decelerates to rest, along the path of axes that move together, and keeps the goal;
  /// who waits for the move goes on waiting. A jog just ends. Until resume() or stop() other
  /// motions are refused. A homing is held too, and its time-out waits meanwhile.
  void hold();

  /// Goes on with what is held. @throw Refused as moveTo().
  void resume();

  /// Finds the axis's zero by its switch, as AxisConfig::homing says, and returns when that is
  /// over. Soft limits don't count meanwhile. Where it fails, the axis stands, enabled as before,
  /// and isn't homed: the result says why. Stops end it; other motions take over from it.
  ///
  /// @param cancelled asked often, from the calling thread: true decelerates and ends it.
  /// @throw Refused where homing isn't configured, while moving, and as moveTo().
  HomingResult home(const std::function<bool()>& cancelled = {});

  /// The same for several axes of one machine at once.
  ///
  /// @throw Refused where one of them can't be homed; then none moves.
  static std::vector<HomingResult> homeTogether(const std::vector<Axis*>& axes,
                                                const std::function<bool()>& cancelled = {});

  /// @throw Refused where home() would be, now.
  void checkHoming() const;

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

  /// What the axis is and does now, whole and from one instant.
  AxisState state() const;

  /// [microsteps/s] The highest rate of the motion under way, as planned; 0 at rest.
  double peakRate() const;

  /// @throw GpioError where a line can't be read.
  EndstopState endstops() const;

  /// @name The machine's side
  /// @{

  /// What is to be kept over a restart; none while it moves.
  std::optional<AxisMemory> memory();

  /// Takes the position of an earlier run. It is trusted only where it was, where that run was shut
  /// down at rest, where the mechanics hold it without current, and where a reset of the chip
  /// leaves the motor where it is; else AxisState::position_note says why not.
  ///
  /// @param clean that run was shut down. @pre nothing has moved yet.
  void restore(const AxisMemory& kept, bool clean);

  /// Says why there is no position of an earlier run.
  void notePosition(const std::string& why);

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
  /// @}

 private:
  friend class Coordination;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::axis
