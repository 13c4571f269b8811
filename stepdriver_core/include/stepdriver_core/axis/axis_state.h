#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/driver/driver_state.h"

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

}  // namespace stepdriver::axis
