#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "axis/axis_memory.h"
#include "fault.h"
#include "flag_places.h"
#include "input_levels.h"
#include "line_failure.h"
#include "line_names.h"
#include "machine_mode.h"
#include "motor/motor.h"
#include "point_to_point/motion_limits.h"
#include "point_to_point/setpoint_stream.h"
#include "position.h"
#include "profile/profile.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/config/axis_config.h"
#include "trajectory/ended_path.h"
#include "trajectory/path_axis.h"

namespace stepdriver::axis {

/// An axis as the controller knows it: a motor, the scale of its counts, the limits of its motions,
/// and its fault. It has no lock, no clock and no line.
///
/// Counts are the joint's unless stated otherwise: the motor's differ by the part of the backlash
/// that is taken up.
class AxisModel {
 public:
  /// @param machine_mode, input_levels, line_names outlive the axis.
  AxisModel(config::AxisConfig axis_config, const motor::MotorLines& motor_lines, int channel,
            const MachineMode& machine_mode, const InputLevels& input_levels,
            const LineNames& line_names);

  const config::AxisConfig config;
  motor::Motor motor;
  Position position;
  FlagPlaces flag_places;  ///< those of the last homing, if it was one to a flag
  Fault fault;
  bool is_being_homed = false;
  motion::SetpointStream setpoints;
  const MachineMode& mode;
  const InputLevels& inputs;
  const LineNames& lines;

  const std::string& name() const { return config.name; }
  bool moving() const { return motor.moving(); }

  /// @name Scales, in the current microstep mode
  /// @{
  double stepsPerUnit() const { return stepsPerUnit(motor.microsteps()); }  ///< [microsteps/unit]
  double stepsPerUnit(int microsteps) const;  ///< [microsteps/unit] in that mode
  double positionOf(double count) const { return position.origin() + count / stepsPerUnit(); }
  double countOf(double at) const { return (at - position.origin()) * stepsPerUnit(); }
  std::int64_t backlash() const;  ///< [microsteps] the nearest whole number of them
  /// [microsteps] The same in a mode, of which it need not be whole microsteps.
  double exactBacklash(int microsteps) const { return config.backlash * stepsPerUnit(microsteps); }
  /// [microsteps] see config::AxisConfig
  double switchRelease(int microsteps) const {
    return config.switch_release * stepsPerUnit(microsteps);
  }
  /// The part of the backlash that is taken up, at rest: from 0 to 1.
  double takenUp() const;
  /// [microsteps] The count in a mode. @param part see takenUp().
  double takenUpIn(int microsteps, double part) const;
  std::int64_t jointCount() const { return motor.state().count - motor.state().slack; }
  /// [microsteps] The same of an axis that shares motors, whose steps may be parts of its own.
  double exactCount() const { return static_cast<double>(jointCount()) + motor.state().between; }
  /// [microsteps] The end of its last motion, if it is at rest: within reach() of exactCount().
  double restCount() const {
    return config.kinematics ? motor.state().rests_at : static_cast<double>(jointCount());
  }
  /// [microsteps] How far it may be from a target that it has reached. Each motor is on the whole
  /// microstep that is nearest to its part of the target.
  double reach() const { return reach_; }
  /// [microsteps] Where it will be at rest if its motion, and those of its sharers, have come to
  /// their ends.
  /// @param end_of [microsteps] the end of each of them.
  double restWith(const std::function<double(const AxisModel&)>& end_of) const;
  /// [microsteps] The end of its motion as it is planned, or its place at rest.
  double plannedEnd() const;
  /// [microsteps] The position of the joint when the motor has moved to a count without a reversal.
  double jointAt(double motor_count) const;
  /// [microsteps] Where the joint was at a motion time, by its plans. @pre Motor::watchMotions()
  double jointAtTime(std::int64_t at) const;
  /// 1 or -1: where the joint moved at a motion time; 0: it rested, or turned less than a
  /// millisecond before or after it. @pre Motor::watchMotions()
  int directionAtTime(std::int64_t at) const;
  double positionNow() const { return positionOf(exactCount()); }
  /// A value with its unit, for messages.
  std::string show(double value, const char* per = "") const { return pathAxis().show(value, per); }
  /// Where it stands or comes to rest, as messages show it.
  std::string showPlace(double at) const { return pathAxis().showPlace(at); }
  /// @}

  /// @name For paths of several axes
  /// @{
  motion::PathAxis pathAxis() const;
  /// Its state at a motion time.
  motion::PathStart pathStart(std::int64_t at) const;
  /// The state at a motion time that may be far ahead, if its motion continues as planned.
  motion::PathStart laterPathStart(std::int64_t at) const;
  /// The same at the end of, or during, another motion of the motor before that.
  motion::PathStart laterPathStart(std::int64_t at, const motion::Profile& planned) const;
  /// @}

  /// @name Limits
  /// @{
  double maxSpeed() const;  ///< [unit/s]
  config::LimitSource maxSpeedSource() const;
  /// [microsteps] @param velocity [unit/s] the highest speed.
  motion::MotionLimits limits(double velocity) const;
  /// [microsteps] The configured limits, of every stop, regardless of setLimits(). Their speed and
  /// acceleration are for the way to the next whole microstep, from a crawl.
  motion::MotionLimits stopLimits() const;
  /// How long DIR must stand still, in total, around a turn of any of its motors.
  pulse::Nanoseconds turnTime() const;
  /// Steps closer than this are at a speed that the motor can't start from without a ramp.
  pulse::Nanoseconds restartInterval() const;
  const AxisLimits& limitsOfNextPlan() const { return limits_; }
  void changeLimits(const AxisLimits& wanted) { limits_ = wanted; }
  /// @}

  /// @name Refusals
  /// @{
  [[noreturn]] void refuse(const std::string& why) const;
  void refuseUnlessOpen() const;
  void refuseWhileHeld() const;
  void refuseUnlessHomed() const;
  /// Closed, at fault, disabled or asleep.
  void refuseUnlessReady() const;
  void refuseUnlessFinite(const char* what, double value, const char* per = "") const;
  void refuseTooFast(double speed) const;
  /// @param lowest [steps] 0 is never refused.
  void refuseTooLow(const char* what, double wanted, double lowest, const char* per) const;
  void refuseBeyondLimits(double at, const std::string& what) const {
    pathAxis().refuseBeyondLimits(at, what);
  }
  /// @param steps to make; 0 is never refused.
  void refuseIntoEndstop(std::int64_t steps) const;
  /// Where a homing can't begin: a switch that it shares is pressed, and another axis may do it, or
  /// its other end does.
  void refuseHomingOnSharedSwitch() const;
  void refuseMicrosteps(int wanted) const;
  /// [unit/s] The requested velocity, or the maximum if that is 0.
  double checkedVelocity(double velocity) const;
  AxisLimits checkedLimits(const AxisLimits& wanted) const;
  /// @}

  /// Whether an endstop of a motor is active; empty if it has none. @throw GpioError if its line
  /// can't be read.
  std::optional<bool> endstopActive(std::size_t motor_index, bool at_max) const;
  /// Whether that of any motor is. @throw GpioError
  bool anyEndstopActive(bool at_max) const;
  /// "the min endstop", and with whom it shares its line.
  std::string endstopText(bool at_max) const;
  /// Whether it stops motions towards that end, at rest: not if the other end presses the switch
  /// that both share. @throw GpioError
  bool isStoppedAt(bool at_max) const;
  /// @throw GpioError
  int readInput(int line) const;
  /// @name The driver of a motor of the axis, or of those that it shares: its own is the first one
  /// @{
  const driver::DriverChip& chipAt(std::size_t motor_index) const;
  /// Its serial port; nullptr: it has none.
  motor::TmcChip* registersAt(std::size_t motor_index);
  /// "the A4988", and of which motor if there are several.
  std::string chipText(std::size_t motor_index) const;
  /// @}
  /// A line that failed, in words.
  std::string failureText(const pulse::LineFailure& failure) const;
  /// A STEP line whose chip can't be used any more, in words; empty: there is none.
  std::string lostLineText() const;

  /// @name The driver chip
  /// @{ The motor was without current for a while.
  void noteUnpowered();
  /// Whether the motor holds the load, and the brake may be released: it has current and power,
  /// there is no fault, and the machine wasn't shut down.
  bool motorHolds() const;
  /// Whether something must be done before a motion of an axis that is ready to move: it is idle,
  /// or its brake is engaged.
  bool mustWake() const;
  /// What RESET, sleep and disabling do to the motors and their translators.
  void noteReset();
  void noteAsleep();
  void noteDisabled();
  /// The chips have lost their supply, and with it their phases.
  void noteSupplyLost();
  /// @}

  /// @name Axes that share motors
  /// @{
  /// @param axes all of them, in the order of the kinematics; they live as long as this one.
  /// @throw Refused if it has something that such an axis can't have.
  void shareMotors(const std::vector<AxisModel*>& axes);
  /// @param axes that have a switch on a line of this one's, without itself.
  void shareSwitches(std::vector<const AxisModel*> axes) { switch_sharers_ = std::move(axes); }
  const std::vector<const AxisModel*>& switchSharers() const { return switch_sharers_; }
  /// All others that do; empty if its motors are its own.
  const std::vector<AxisModel*>& sharers() const { return sharers_; }
  /// The fault of this axis, or that of a sharer, which lets it not move either; empty if there is
  /// none.
  std::string faultText() const;
  std::string remedyText() const;
  /// Its position can't be trusted any more: nor can that of any axis that its motors move.
  void distrust();
  /// @}

  /// @name Over a restart
  /// @{
  AxisMemory memory() const;
  /// The patterns of its motors' coils, if lines switch them, continue where they were.
  void continueCoils(const AxisMemory& kept);
  /// Called at the end of each turn: if the axis is at rest, a motion may begin from here.
  void rememberRest();
  /// Why a kept position can't be the axis's; empty if it can.
  /// @param source "the state file /x/state"
  std::string whyImpossible(const AxisMemory& kept, const std::string& source) const;
  /// Why a possible position can't be trusted; empty if it can.
  std::string whyUnverified(const AxisMemory& kept, bool clean, const std::string& source) const;
  /// @}

  /// Its motion has ended at an endstop that it wasn't looking for.
  void noteEndstop(bool at_max);
  /// Why a motion has ended at an endstop, as the begin of a sentence: "the min endstop was met".
  std::string metText(bool at_max) const;
  /// Whether its last motion ended too fast for the position to be trusted, as the end of a
  /// sentence; empty if it didn't.
  std::string abruptText() const;

  /// Something stopped it, moving or not: its command has ended.
  void noteStop() {
    ++stops;
    position.dropRemainder();
  }
  /// The machine is on hold from now on, or not any more.
  void noteHold() {
    ++stops;
    ++holds;
  }

  /// The last path of several axes that it has followed to an end; nullptr if there is none.
  std::shared_ptr<const motion::EndedPath> ended_path;
  /// Clock time at which its last activity ended.
  pulse::Nanoseconds rest_since = 0;
  /// How often something stopped it, other than the end of its motion.
  std::uint64_t stops = 0;
  /// How many of them were holds, or the ends of holds: then a motion continues.
  std::uint64_t holds = 0;
  /// AxisState::stopped_by and endstops_met.
  std::string stopped_by;
  std::uint64_t endstops_met = 0;

 private:
  /// [unit/s] At finer microsteps than the configured ones it may be below the configured speed.
  double chipsMaxSpeed() const;
  double checkedLimit(const char* what, double wanted, double configured, double lowest,
                      const char* per,
                      config::LimitSource source = config::LimitSource::kConfiguration) const;

  const AxisModel* sharerAtFault() const;
  /// A translator has gone Home: from another phase the motor turns when it has current again.
  void noteHome(std::size_t motor_index);
  void noteOff(driver::TranslatorState driver::DriverChip::*meanwhile);
  /// A chip's translator follows STEP without current.
  bool countsWhileDisabled() const;

  /// What the drivers whose place is known say of the time since a memory.
  enum class ChipsSince {
    kSame,     ///< all of them have kept their power, and have counted no step
    kStepped,  ///< one has kept its power, and has counted steps
    kUnknown,
  };
  ChipsSince chipsSince(const AxisMemory& kept) const;
  /// For each motor whose place in the electrical cycle is known, of this axis and of those that
  /// share its motors: its driver has registers, or lines switch its coils.
  void forEachPlaced(const std::function<void(const motor::Motor& any, std::size_t i)>& act) const;

  /// nullptr: no other axis has a switch on the line of this one.
  const AxisModel* sharerOfSwitch(bool at_max) const;

  std::vector<AxisModel*> sharing_;  // in the order of the kinematics
  std::vector<AxisModel*> sharers_;  // without itself
  std::vector<const AxisModel*> switch_sharers_;
  double reach_ = 0.0;
  AxisMemory rest_;  // when it was last at rest
  AxisLimits limits_;
};

}  // namespace stepdriver::axis
