#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "chip_pins.h"
#include "move_log.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/motion/trapezoid.h"
#include "stepdriver_core/pulse/pulse_driver.h"

namespace stepdriver::axis {

/// The state of an Axis under its mutex. Every member function wants the lock held.
class Axis::Impl {
 public:
  Impl(AxisConfig axis_config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
       pulse::PulseDriver& driver);

  // What the engine has done since it was last looked at, taken into this state.
  pulse::ChannelState harvest();
  bool moving() { return harvest().following != 0; }

  // Scales at the microsteps of now.
  double stepsPerUnit() const;
  double maxSpeed() const;
  double positionOf(double count) const { return origin + count / stepsPerUnit(); }
  double countOf(double position) const { return (position - origin) * stepsPerUnit(); }
  motion::TrapezoidLimits limits(double velocity) const;
  std::string show(double value, const char* per = "") const;
  static std::string inMilliseconds(pulse::Nanoseconds time);

  // Orders to the engine.
  Move start(std::int64_t target, double velocity);
  Move checkedMove(double position, bool relative, double velocity);
  void decelerate(const std::string& stopped_by);
  /// Both let go of the lock while the axis comes to rest.
  void awaitRest(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void restAndDisable(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void writePins(const pulse::PinSequence& sequence, std::optional<std::int64_t> count = {});
  void restorePins();
  void resetFaultyChip();

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
  bool enabled = false;
  bool asleep = false;
  bool disabling = false;
  bool homed = false;
  bool position_valid = false;
  int microsteps;
  double origin = 0.0;          // [unit] the position at count 0
  std::int64_t home_count = 0;  // a count at which the translator is at Home
  std::string fault;
  std::string closed;
  MoveLog log;

 private:
  void follow(Motion motion, const std::function<motion::Profile(std::int64_t)>& plan);
  void conclude(const pulse::ChannelState& state);
  MoveResult resultOf(const Motion& motion, const pulse::ChannelState& state);

  std::uint64_t serial_ = 0;
  std::uint64_t moves_ = 0;
  std::uint64_t ended_seen_ = 0;
  std::uint64_t line_errors_seen_ = 0;
  std::uint64_t chip_faults_seen_ = 0;
  bool pins_doubtful_ = false;  // a write failed: they may be as wanted or not
  int mode_failed_ = 0;         // the mode whose pins could not all be written; 0: none
};

}  // namespace stepdriver::axis
