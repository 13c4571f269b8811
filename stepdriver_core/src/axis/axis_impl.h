#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "chip_pins.h"
#include "move_log.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/motion/planner.h"
#include "stepdriver_core/pulse/pulse_driver.h"

namespace stepdriver::axis {

/// The state of an Axis under its mutex. Every member function wants the lock held.
class Axis::Impl {
 public:
  Impl(AxisConfig axis_config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
       pulse::PulseDriver& driver);

  static constexpr const char* kEmergencyStop = "emergency stop";
  static constexpr const char* kEmergencyStopInput = "emergency stop input";

  // What the engine has done since it was last looked at, taken into this state.
  pulse::ChannelState harvest();
  bool moving() { return harvest().following != 0; }

  // Scales at the microsteps of now.
  double stepsPerUnit() const;
  double maxSpeed() const;
  double positionOf(double count) const { return origin + count / stepsPerUnit(); }
  double countOf(double position) const { return (position - origin) * stepsPerUnit(); }
  motion::MotionLimits limits(double velocity) const;
  std::string show(double value, const char* per = "") const;
  static std::string inMilliseconds(pulse::Nanoseconds time);

  // Orders to the engine.
  Move startMove(std::int64_t target, double velocity);
  Move checkedMove(double position, bool relative, double velocity);
  void checkedJog(double velocity);
  void decelerate(const std::string& stopped_by);
  void changeOverride(double factor);
  /// Both let go of the lock while the axis comes to rest.
  void awaitRest(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void restAndDisable(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void writePins(const pulse::PinSequence& sequence, std::optional<std::int64_t> count = {});
  void restorePins();
  void resetFaultyChip();

  // The motor's current.
  bool isEnabled() const {
    return enabled && !(idle && config.idle_action == IdleAction::kDisable);
  }
  bool isAsleep() const { return asleep || (idle && config.idle_action == IdleAction::kSleep); }
  pulse::Nanoseconds superviseIdle();
  void wake();
  void noteUnpowered();
  void noteHome();

  // Microstep modes.
  void refuseMicrosteps(int wanted);
  std::int64_t nearestCommon(int wanted);
  void changeMicrosteps(int wanted);

  // A line that failed, in words.
  std::string failureText(const pulse::LineFailure& failure) const;
  int readInput(int line) const;

  // Refusals.
  [[noreturn]] void refuse(const std::string& why) const {
    throw Refused(config.name + ": " + why);
  }
  void refuseUnlessOpen() const;
  void refuseWhileMoving(const std::string& what);
  void refuseUnlessReadyToMove();
  void refuseTooFast(double speed) const;
  void refuseBeyondLimits(double position, const std::string& what) const;
  void refuseIntoEndstop(std::int64_t steps) const;
  std::optional<bool> endstopActive(int line, const std::optional<Endstop>& endstop) const;

  const AxisConfig config;
  const chip::Chip& chip;
  const AxisLines axis_lines;
  const ChipPins pins;
  gpio::Lines& lines;
  pulse::PulseDriver& driver;
  const int channel;

  mutable std::mutex mutex;
  // As was commanded; while the axis is idle its pins are otherwise.
  bool enabled = false;
  bool asleep = false;
  bool idle = false;
  bool disabling = false;
  bool homed = false;
  bool position_valid = false;
  int microsteps;
  double origin = 0.0;                // [unit] the position at count 0
  std::int64_t home_count = 0;        // a count at which the translator is at Home
  pulse::Nanoseconds rest_since = 0;  // clock time of the last thing that it did
  double speed_override = 1.0;
  std::string fault;
  std::string closed;
  MoveLog log;

 private:
  double checkedVelocity(double velocity) const;
  double relativeOrigin(std::int64_t count);
  const Motion* underWay();
  const Motion& begin(Goal goal);
  void follow(const Goal& goal);
  std::uint64_t send(const Goal& goal, pulse::Nanoseconds lead);
  std::int64_t stepsTo(const Goal& goal);
  motion::Plan plan(const Goal& goal, std::int64_t at, const Motion* before,
                    std::int64_t count) const;
  motion::Profile planStopOf(const Motion& before, std::int64_t at,
                             const motion::MotionState& from) const;
  pulse::Nanoseconds restartInterval() const;
  MoveResult replacedBy(const Motion& motion, std::int64_t began);
  void conclude(const pulse::ChannelState& state);
  MoveResult resultOf(const Motion& motion, const pulse::ChannelState& state);

  std::uint64_t serial_ = 0;
  std::uint64_t moves_ = 0;
  std::uint64_t ended_seen_ = 0;
  std::uint64_t line_errors_seen_ = 0;
  std::uint64_t chip_faults_seen_ = 0;
  std::uint64_t input_stops_seen_ = 0;
  bool pins_doubtful_ = false;  // a write failed: they may be as wanted or not
  int mode_failed_ = 0;         // the mode whose pins could not all be written; 0: none
};

}  // namespace stepdriver::axis
