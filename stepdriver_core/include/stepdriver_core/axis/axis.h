#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::axis {

/// The result of something that takes time: empty while it is under way, set once when it is over.
/// Any thread may read it.
template <typename Result>
class Outcome {
 public:
  std::optional<Result> get() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return result_;
  }

  /// Only the first result counts.
  void set(Result result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!result_) result_ = std::move(result);
  }

 private:
  mutable std::mutex mutex_;
  std::optional<Result> result_;
};

/// The limits of the motions of an axis. A unit is m on a linear axis, rad on a rotary one.
struct AxisLimits {
  double max_speed = 0.0;     ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2]
  double deceleration = 0.0;  ///< [unit/s^2] not of stops, which use the configured one
  double jerk = 0.0;          ///< [unit/s^3] 0: no limit, the acceleration may jump
};

/// The phases of a homing.
enum class HomingPhase {
  kNone,
  kLeaving,     ///< off the switch, if it was closed at the beginning
  kSeeking,     ///< towards the switch
  kBackingOff,  ///< off the switch, until it is open
  kLatching,    ///< slowly towards the switch: the place where it closes is the trigger point
  kPullingOff,  ///< from the trigger point to the final position
  kStopping,    ///< it has failed, and the axis comes to rest
};

/// The phase in words, as in messages: `seeking`.
const char* nameOf(HomingPhase phase);

/// How a homing ended.
enum class HomingEnd { kHomed, kCancelled, kFailed };

/// How and where the homing of an axis ended.
struct HomingResult {
  std::string axis;
  HomingEnd end = HomingEnd::kFailed;
  std::string message;    ///< a sentence that says how it ended and where
  double position = 0.0;  ///< [unit] where the axis stands
  /// [unit] How far its motors were apart before this homing made them square; 0 if it has only
  /// one.
  double skew = 0.0;
};

/// What an axis is and does at one instant. A unit is m on a linear axis, rad on a rotary one.
///
/// @code{.cpp}
/// const axis::AxisState state = machine.axis("x").state();
/// if (!state.position_valid) std::cout << "x must be homed\n";
/// if (!state.fault.empty()) std::cout << state.fault << ": " << state.remedy << "\n";
/// @endcode
struct AxisState {
  /// By its own commands, and with power; a shared ENABLE line may energize it all the same.
  bool enabled = false;
  bool asleep = false;
  /// The power of all motors is there, or nothing switches it: see MachineOptions::motor_power.
  bool powered = true;
  /// The line of its brake has the level that engages it, or could not be given that level. False
  /// while it is released, and if the axis has no brake.
  bool brake_engaged = false;
  /// Disabled, asleep or at a lower current by its idle timeout; the next motion ends that.
  bool idle = false;
  bool moving = false;
  bool held = false;  ///< the machine is on hold: this axis too, moving or not
  bool homed = false;
  HomingPhase homing = HomingPhase::kNone;  ///< the phase of a homing under way
  bool position_valid = false;              ///< the position can be trusted
  int microsteps = 1;
  double speed_override = 1.0;  ///< the factor of all velocities, see Machine::setSpeedOverride()
  double position = 0.0;        ///< [unit] from the count of the edges that went out
  /// [unit] The planned position of the motion under way; the position at rest. The count and the
  /// clock can't be read at one instant: of the places that the plan passed meanwhile, this is the
  /// one that is nearest to the position.
  double planned = 0.0;
  double velocity = 0.0;  ///< [unit/s] as planned
  double slack = 0.0;     ///< [unit] the part of the backlash that is taken up towards max
  double skew = 0.0;      ///< [unit] how far its motors have got apart since they were square
  /// [unit] Where the motion under way ends; the position at rest, and in a jog without an end.
  double target = 0.0;
  /// [s] Until the motion under way ends, as planned; 0 at rest and in a jog without an end.
  double time_left = 0.0;
  std::string fault;   ///< in words; empty: no fault
  std::string remedy;  ///< what ends the fault, in words; empty if there is none
  /// At which endstop its last motion ended, and where; empty: at none, it was a homing, or the
  /// next motion has begun.
  std::string stopped_by;
  /// How many motions have ended at an endstop, except those of a homing.
  std::uint64_t endstops_met = 0;
  /// How many times something has stopped the axis, moving or not (a stop, a hold, a disable, a
  /// sleep, a fault, an emergency stop), or ended that (a resume, an enable, a wake, a recover).
  std::uint64_t stops = 0;
  /// Why the position that was kept over a restart can't be trusted, or why one that is valid is
  /// doubtful (kWarning of config::FlagCheck); empty: there is no such reason.
  std::string position_note;
  /// Of each motor whose chip has a serial port, what the chip said last; nullptr: no chip has one.
  std::shared_ptr<const std::vector<driver::DriverState>> drivers;
};

/// Levels of the switches as their lines read now: true if active, empty if there is no switch.
struct EndstopState {
  std::optional<bool> min;
  std::optional<bool> max;
};

/// How a move ended.
enum class MoveEnd {
  kReached,
  kStopped,     ///< by a stop, a disable or a shutdown; decelerated
  kReplaced,    ///< by a later move or a jog, which took over while it was under way
  kEndstopMin,  ///< the min endstop was met
  kEndstopMax,
  kEmergencyStop,
  kFault,      ///< pulses too late, or a line that failed
  kCompanion,  ///< an axis that it moved together with was stopped by one of these
};

/// How and where a move ended, as its waiting caller is told.
struct MoveResult {
  MoveEnd end = MoveEnd::kReached;
  std::string message;    ///< a sentence that says how and where
  double position = 0.0;  ///< [unit] where the axis stands
  double duration = 0.0;  ///< [s] the time that the motion took
  /// Places at which its path switched outputs, and those at which it didn't because it ended
  /// before, see motion::PathSegment::outputs.
  std::uint64_t marks_made = 0;
  std::uint64_t marks_not_made = 0;
  /// False if the pulse thread hangs: both numbers are 0 then, and nothing is known about them.
  bool marks_known = true;
};

/// A motion that was accepted.
struct Move {
  std::uint64_t id = 0;    ///< never the same twice on one axis
  double target = 0.0;     ///< [unit] the commanded position
  double rest = 0.0;       ///< [unit] the microstep nearest to it, where the axis comes to rest
  double duration = 0.0;   ///< [s] as planned
  double overshoot = 0.0;  ///< [unit] beyond the target, if the axis can't stop before it
  /// Its result appears here.
  std::shared_ptr<const Outcome<MoveResult>> outcome;
};

/// A cubic piece of position over time: position + velocity t + acceleration t^2/2 + jerk t^3/6.
struct MovePiece {
  double duration = 0.0;      ///< [s]
  double position = 0.0;      ///< [unit] where it begins, as the three below
  double velocity = 0.0;      ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2]
  double jerk = 0.0;          ///< [unit/s^3] all through it
};

/// A part of a motion that an input shaper makes later.
struct MotionPart {
  double part = 1.0;   ///< the share of the whole
  double delay = 0.0;  ///< [s]
};

/// What a move would be, piece after piece. Positions are those of the motor: with a backlash they
/// differ from the joint's by the part that is taken up.
struct MovePlan {
  Move move;                      ///< its id is 0
  double steps_per_unit = 0.0;    ///< [microsteps/unit] in the present microstep mode
  std::vector<MovePiece> pieces;  ///< as planned; empty if nothing would move
  /// The axis moves by the sum of these parts of the pieces, and of the motion before; empty if
  /// motions aren't shaped.
  std::vector<MotionPart> parts;
};

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
