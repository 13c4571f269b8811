#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::axis {

/// One axis of a machine::Machine, which makes it: units in, pulses out.
///
/// All calls are safe from any thread. The machine carries out the calls of all its axes one after
/// another, in the order in which they arrive. Every command is either accepted as a whole, or
/// throws Refused and changes nothing. A unit is m on a linear axis, rad on a rotary one.
///
/// @code{.cpp}
/// axis::Axis& x = machine.axis("x");
/// x.enable(true);
/// const axis::MoveResult result = x.wait(x.moveTo(0.05));  // [m]
/// std::cout << result.message << "\n";                      // "x reached 0.05 m"
/// @endcode
class Axis {
 public:
  struct Impl;

  /// Called by the machine.
  explicit Axis(std::unique_ptr<Impl> impl);
  ~Axis();
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  /// As configured. limits() and state() have what setLimits() and setMicrosteps() change.
  const config::AxisConfig& config() const;

  /// Moves to a position and rests there. It can interrupt another motion without a jump in speed
  /// or acceleration; the caller of the interrupted move is told. If the axis can't stop before its
  /// target, it overshoots and comes back; Move::overshoot says how far.
  ///
  /// @param position [unit] absolute. If `relative`, it counts from the commanded position: the
  ///   target of the last move, even during that move. After a stop, a fault, a homing, an endstop
  ///   or setPosition() it counts from the position of the axis.
  /// @param velocity [unit/s] highest speed on the way; 0: the axis's maximum.
  /// @param shortest whole turns don't count: the axis goes to the nearest place at which it stands
  ///   as it would at `position`. Only on an axis with AxisConfig::continuous.
  /// @throw Refused if a number isn't finite, the target is beyond a soft limit, the velocity is
  ///   beyond the axis's maximum, the endstop on the way is active, the axis is disabled, asleep or
  ///   at fault, the machine is on hold or shuts down, the position is absolute and the axis must
  ///   be homed first, or `shortest` is true and the position is relative or the axis isn't
  ///   continuous.
  Move moveTo(double position, bool relative = false, double velocity = 0.0, bool shortest = false);

  /// What moveTo() would do now; nothing moves.
  ///
  /// @throw Refused as moveTo().
  MovePlan plan(double position, bool relative = false, double velocity = 0.0,
                bool shortest = false);

  /// Turns the motor by a number of revolutions, which need not be whole.
  ///
  /// @throw Refused as moveTo(), and if the steps of a revolution are not known.
  Move moveRounds(double rounds, double velocity = 0.0);

  /// How a move ended, however long ago; empty if it hasn't ended.
  std::optional<MoveResult> result(const Move& move) const;

  /// Returns when the move has ended. @throw Refused for a move of plan().
  MoveResult wait(const Move& move);

  /// The same, for at most this time of the computer's clock, or of a virtual clock if the machine
  /// has no threads; then it also notices, within a millisecond, what its inputs do meanwhile.
  ///
  /// @return empty if the move hasn't ended by then; it continues.
  std::optional<MoveResult> waitFor(const Move& move, std::chrono::nanoseconds longest);

  /// Moves at a velocity until another command comes, or up to the soft limit, and rests there. 0
  /// ends a jog. A motion under way is replaced. A call with the velocity that the jog has already
  /// changes nothing.
  ///
  /// @param velocity [unit/s] negative: towards min.
  /// @param unless_stopped_since AxisState::stops as it was when the stream of jogs began that this
  ///   one belongs to: a stream does not continue after a stop, a hold, a disable or a recover.
  /// @throw Refused as moveTo(), and if the axis rests at the soft limit ahead, or has been stopped
  ///   since.
  void jog(double velocity, std::optional<std::uint64_t> unless_stopped_since = {});

  /// Changes the limits of motions, within what is configured. They apply to the next plan: a move,
  /// a jog or a setpoint under way is planned again at once. If it would pass its target or a soft
  /// limit farther with the new limits than with the old ones, it keeps the old acceleration,
  /// deceleration and jerk to its end. An acceleration that a lower jerk can't take back before
  /// standstill or the highest speed is taken back with the jerk that this needs. Axes that move
  /// together keep the limits that they began with. Stops always use the configured deceleration
  /// and jerk.
  ///
  /// @param wanted 0: as configured.
  /// @throw Refused if a number isn't 0 or between the lowest limit and the configured one. A jerk
  ///   has no upper bound if no jerk limit is configured.
  void setLimits(const AxisLimits& wanted);

  /// The limits of the next plan.
  AxisLimits limits() const;

  /// Changes the currents of its motors whose drivers have a config::TmcConfig, at rest or in
  /// motion, until the machine ends. The highest step of the chip's scale that doesn't exceed the
  /// current is taken: see driver::DriverState. Returns when the chip has it.
  ///
  /// @param run [A rms] in motion, at most TmcConfig::run_current; 0: as configured.
  /// @param hold [A rms] at rest, at most that in motion; 0: as configured, or that in motion if it
  ///   is lower.
  /// @throw Refused if a current is out of range, if no motor has such a driver, or while one isn't
  ///   set up. @throw GpioError if a chip doesn't take it: the axis is then at fault.
  void setCurrent(double run, double hold);

  /// Changes the threshold of stalls in any motion of its driver chips on SPI, and of others with a
  /// StallFaultConfig, until the machine ends; a homing to a stall keeps its own. On SPI it shifts
  /// driver::DriverState::stall_guard, which is how one that suits the motor is found. Returns when
  /// the chip has it.
  ///
  /// @param threshold see config::StallConfig.
  /// @throw Refused if it is out of range, if a motor has no such driver, while one isn't set up,
  ///   and in a homing to a stall. @throw GpioError if a chip doesn't take it: the axis is then at
  ///   fault.
  void setStallThreshold(int threshold);

  /// Decelerates to rest, and returns when the pulse thread has the deceleration. The axes that
  /// move together with this one stop with it, along their path. A held goal is given up. Does
  /// nothing if the axis is at rest.
  void stop();

  /// Stops the axis if it still makes this move or holds it. A motion that has replaced the move
  /// continues.
  void stop(const Move& move);

  /// Finds the axis's zero by its switch, as AxisConfig::homing says, and returns when the homing
  /// is over. Soft limits don't apply meanwhile. If it fails, the axis rests, enabled as before,
  /// and isn't homed: the result says why. A stop ends it; another motion takes over from it.
  ///
  /// @param cancelled is asked often, in the calling thread: true decelerates and ends the homing.
  /// @throw Refused as moveTo(), if homing isn't configured, and while the axis moves.
  HomingResult home(const std::function<bool()>& cancelled = {});

  /// @throw Refused if home() would be refused now.
  void checkHoming() const;

  /// Energizes the motor, or takes its current away; a motion under way is stopped first. Nothing
  /// holds a motor without current: disabling invalidates the position, unless
  /// AxisConfig::holds_position_unpowered is set.
  ///
  /// @throw Refused if enable isn't wired, or if the call enables a faulty axis.
  void enable(bool on);

  /// Puts the chip to sleep, or wakes it. A chip wakes at its Home position, so the axis's position
  /// stays valid only if the translator was there and AxisConfig::holds_position_unpowered is set.
  ///
  /// @throw Refused while the axis moves, and if SLEEP isn't wired.
  void sleep(bool asleep);

  /// Pulses RESET: the translator returns to its Home position.
  ///
  /// @throw Refused while the axis moves, and if RESET isn't wired.
  void reset();

  /// Changes the microstep mode and keeps the position; the steps per unit follow. If the new mode
  /// has no microstep at this position, the change is refused. With
  /// AxisConfig::align_on_microstep_change the axis moves to the nearest common position first, and
  /// the call waits for that.
  ///
  /// @throw Refused while the axis moves, if the chip doesn't have the mode or its pins aren't
  ///   wired, and for a chip whose mode is set by switches.
  void setMicrosteps(int microsteps);

  /// Declares where the axis stands; the position is valid from then on. Nothing moves.
  ///
  /// @throw Refused while the axis moves, and if the number isn't finite or is beyond a soft limit.
  void setPosition(double position);

  /// What the axis is and does now: consistent, of one instant.
  AxisState state() const;

  /// [microsteps/s] The highest planned rate of the motion under way; 0 at rest.
  double peakRate() const;

  /// @throw GpioError if a line can't be read.
  EndstopState endstops() const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::axis
