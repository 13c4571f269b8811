#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "axis/axis_memory.h"
#include "fault.h"
#include "input_levels.h"
#include "line_failure.h"
#include "line_names.h"
#include "machine_mode.h"
#include "motion/limits.h"
#include "motion/profile.h"
#include "motor/motor.h"
#include "path_axis.h"
#include "position.h"
#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::axis {

/// An axis as the controller knows it: a motor, what its counts mean in the axis's unit, what its
/// motions keep to, and its fault. It has no lock, no clock and no line.
///
/// Counts are the joint's unless they are said to be the motor's: the motor's are off by what is
/// taken up of the backlash.
class AxisModel {
 public:
  /// @param machine_mode, input_levels, line_names outlive the axis.
  AxisModel(config::AxisConfig axis_config, const motor::MotorLines& motor_lines, int channel,
            const MachineMode& machine_mode, const InputLevels& input_levels,
            const LineNames& line_names);

  const config::AxisConfig config;
  motor::Motor motor;
  Position position;
  Fault fault;
  const MachineMode& mode;
  const InputLevels& inputs;
  const LineNames& lines;

  const std::string& name() const { return config.name; }
  bool moving() const { return motor.moving(); }

  /// @name Scales, in the microstep mode of now
  /// @{
  double stepsPerUnit() const { return stepsPerUnit(motor.microsteps()); }  ///< [microsteps/unit]
  double stepsPerUnit(int microsteps) const;  ///< [microsteps/unit] in that mode
  double positionOf(double count) const { return position.origin() + count / stepsPerUnit(); }
  double countOf(double at) const { return (at - position.origin()) * stepsPerUnit(); }
  std::int64_t backlash() const;  ///< [microsteps]
  std::int64_t jointCount() const { return motor.state().count - motor.state().slack; }
  /// [microsteps] Where the joint is once the motor has come to a count, straight on from where it
  /// is.
  double jointAt(double motor_count) const;
  double positionNow() const { return positionOf(static_cast<double>(jointCount())); }
  /// A value with its unit, as messages show it.
  std::string show(double value, const char* per = "") const { return pathAxis().show(value, per); }
  /// @}

  /// @name For paths of several axes
  /// @{
  PathAxis pathAxis() const;
  /// Where it will be at a motion time.
  PathStart pathStart(std::int64_t at) const;
  /// @}

  /// @name Limits
  /// @{
  double maxSpeed() const;  ///< [unit/s]
  /// [microsteps] @param velocity [unit/s] the highest speed.
  motion::MotionLimits limits(double velocity) const;
  /// What every stop keeps to, whatever setLimits() has done: the configured deceleration and jerk.
  motion::MotionLimits stopLimits() const;
  double stopDeceleration() const;  ///< [microsteps/s^2]
  /// Steps closer than this are at a speed that the motor can't start from without a ramp.
  pulse::Nanoseconds restartInterval() const;
  const AxisLimits& limitsOfNextMotion() const { return limits_next_; }
  void changeLimits(const AxisLimits& wanted);
  /// A motion has ended: the limits of the next one hold.
  void atRest() { limits_now_ = limits_next_; }
  /// @}

  /// @name Refusals
  /// @{
  [[noreturn]] void refuse(const std::string& why) const;
  void refuseUnlessOpen() const;
  void refuseWhileHeld() const;
  void refuseUnlessHomed() const;
  /// Closed, at fault, disabled or asleep.
  void refuseUnlessReady() const;
  void refuseTooFast(double speed) const;
  void refuseBeyondLimits(double at, const std::string& what) const {
    pathAxis().refuseBeyondLimits(at, what);
  }
  /// @param steps that it is to make; none is refused for 0.
  void refuseIntoEndstop(std::int64_t steps) const;
  void refuseMicrosteps(int wanted) const;
  /// [unit/s] What is asked for, or the maximum if that is 0.
  double checkedVelocity(double velocity) const;
  AxisLimits checkedLimits(const AxisLimits& wanted) const;
  /// @}

  /// What the levels of the endstops say. @throw GpioError if a line can't be read.
  std::optional<bool> endstopActive(int line, const std::optional<config::Endstop>& endstop) const;
  /// @throw GpioError
  int readInput(int line) const;
  /// A line that failed, in words.
  std::string failureText(const pulse::LineFailure& failure) const {
    return lineFailureText(failure, motor.lines(), lines);
  }

  /// @name The driver chip
  /// @{
  /// The motor had no current for a while.
  void noteUnpowered();
  /// The translator has gone Home: from another phase the motor turns when it has current again.
  void noteHome();
  /// @}

  /// @name Over a restart
  /// @{
  AxisMemory memory() const;
  std::string whyUnverified(const AxisMemory& kept, bool clean) const;
  /// @}

  /// Something stopped it, moving or not: what it was commanded to do is over.
  void noteStop() {
    ++stops;
    position.dropRemainder();
  }

  /// Clock time of the last thing that it did.
  pulse::Nanoseconds rest_since = 0;
  /// Times that something stopped it, other than the end of its motion.
  std::uint64_t stops = 0;

 private:
  double checkedLimit(const char* what, double wanted, double configured, double lowest,
                      const char* per) const;

  AxisLimits limits_now_;   // of the motion under way
  AxisLimits limits_next_;  // of those that begin at rest; the speed is that of now
};

}  // namespace stepdriver::axis
