#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "chip_pins.h"
#include "move_log.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/axis/edge_log.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/motion/planner.h"
#include "stepdriver_core/pulse/pulse_driver.h"

namespace stepdriver::axis {

class Homing;

/// What an axis is to do. Orders of one course go out together.
struct Order {
  Axis::Impl* axis = nullptr;
  Goal goal;
};
using Orders = std::vector<Order>;

/// The state of an Axis under the lock of all axes. Every member function wants that held.
class Axis::Impl {
 public:
  Impl(AxisConfig axis_config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
       EdgeLog& edges, pulse::PulseDriver& driver, std::mutex& mutex);

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
  /// Counts as above are the joint's. The motor's are off by what is taken up of the backlash.
  std::int64_t jointCount();
  /// [microsteps] The joint's place where the motor has come to one, straight on from where it is.
  double jointAt(double motor);
  std::int64_t backlash() const;
  double position() { return positionOf(static_cast<double>(jointCount())); }
  motion::MotionLimits limits(double velocity) const;
  /// [microsteps/s^2]
  double stopDeceleration() const;
  std::string show(double value, const char* per = "") const;
  static std::string inMilliseconds(pulse::Nanoseconds time);

  // Orders to the engine.
  /// Gives each order a move of its own and has them carried out; who waits for what they replace
  /// is told.
  static std::vector<Move> begin(Orders orders);
  Move startMove(std::int64_t target, double velocity);
  /// Moves to a count of the motor's, whatever the backlash.
  Move moveMotor(std::int64_t target);
  /// [microsteps] @throw Refused where it isn't one to move to.
  std::int64_t checkedTarget(double position, bool relative);
  /// @throw Refused as Axis::moveTo().
  Goal checkedGoal(double position, bool relative, double velocity);
  Move checkedMove(double position, bool relative, double velocity);
  /// What a goal would be now; nothing moves.
  MovePlan planOf(const Goal& goal);
  void checkedJog(double velocity);
  void decelerate(const std::string& stopped_by);
  /// The same, of a motion alone: a homing goes on.
  void slowDown(const std::string& stopped_by);
  /// The move that was accepted last; 0: none was.
  std::uint64_t lastMove() const { return moves_; }
  /// The move under way, or that is held; 0: there is none.
  std::uint64_t currentMove();
  /// Brings the motor to where the joint moves with its first step of a way. At rest; lets go of
  /// the lock while it does so.
  void takeUpBacklash(std::unique_lock<std::mutex>& lock, std::int64_t way);
  void changeOverride(double factor);
  void changeLimits(const AxisLimits& wanted);
  /// Whether this is the axis to ask for what it follows or has kept: of a course that is the
  /// first.
  bool leads();
  void hold();
  void resume();
  /// Gives up what a hold has kept, of all axes of its course.
  void dropHeld(MoveEnd end, const std::string& why);
  /// Both let go of the lock while the axis comes to rest.
  void awaitRest(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void restAndDisable(std::unique_lock<std::mutex>& lock, const std::string& stopped_by);
  void writePins(const pulse::PinSequence& sequence,
                 std::optional<pulse::Command::Scale> scale = {});
  void restorePins();
  void resetFaultyChip();

  // The motor's current.
  bool isEnabled() const {
    return enabled && !(idle && config.idle_action == IdleAction::kDisable);
  }
  bool isAsleep() const { return asleep || (idle && config.idle_action == IdleAction::kSleep); }
  pulse::Nanoseconds superviseIdle();
  void wake();
  void writeEnable(bool on);
  void noteUnpowered();
  /// The translator is where it begins after a reset.
  bool isAtHome();
  /// Why a position that was kept can't be trusted; empty: it can.
  std::string whyUnverified(const AxisMemory& kept, bool clean) const;
  void noteHome();

  // Microstep modes.
  void refuseMicrosteps(int wanted);
  std::int64_t nearestCommon(int wanted);
  void changeMicrosteps(int wanted);

  // Homing.
  const HomingConfig& homingConfig() const;
  void interruptHoming(const std::string& why) const;

  void latch(const std::string& what, const std::string& what_to_do);
  void latchEmergencyStop(const char* which);
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
  void refuseUnlessHomed() const;
  void refuseUnlessReady();
  void refuseWhileHeld() const;
  void refuseTooFast(double speed) const;
  double checkedLimit(const char* what, double wanted, double configured, const char* per) const;
  void refuseBeyondLimits(double position, const std::string& what) const;
  void refuseIntoEndstop(std::int64_t steps) const;
  std::optional<bool> endstopActive(int line, const std::optional<Endstop>& endstop) const;

  const AxisConfig config;
  const chip::Chip& chip;
  const AxisLines axis_lines;
  const ChipPins pins;
  gpio::Lines& lines;
  EdgeLog& edges;
  pulse::PulseDriver& driver;
  const int channel;

  std::mutex& mutex;
  // As was commanded; while the axis is idle its pins are otherwise.
  bool enabled = false;
  bool asleep = false;
  bool idle = false;
  bool disabling = false;
  bool homed = false;
  Homing* homing = nullptr;  // the one under way
  bool position_valid = false;
  int microsteps;
  double origin = 0.0;                // [unit] the position at count 0
  std::int64_t home_count = 0;        // a count at which the translator is at Home
  pulse::Nanoseconds rest_since = 0;  // clock time of the last thing that it did
  double speed_override = 1.0;
  AxisLimits limits_now;   // of the motion under way
  AxisLimits limits_next;  // of those that begin at rest; the speed is that of now
  std::string fault;
  std::string remedy;
  std::string position_note;
  std::string closed;
  MoveLog log;
  std::optional<Held> held;

  /// [microsteps] Where a relative motion begins.
  double relativeOrigin();
  /// The motion that the engine has; nullptr at rest.
  const Motion* underWay();
  /// [microsteps] Where the motor will be at a motion time.
  motion::MotionState stateAt(std::int64_t at);

 private:
  double checkedVelocity(double velocity) const;
  /// The orders that the axes of a motion have now.
  Orders ordersOf(const Goal& goal);
  static void carryOut(const Orders& orders);
  static std::vector<pulse::Follow> send(const Orders& orders, pulse::Nanoseconds lead);
  static std::shared_ptr<const motion::Profile> planPath(const Orders& orders, std::int64_t at);
  bool taken(const pulse::Follow& follow) const;
  pulse::Nanoseconds earliest(pulse::Nanoseconds now, pulse::Nanoseconds lead);
  Motion planned(const Goal& goal, std::int64_t at,
                 const std::shared_ptr<const motion::Profile>& path);
  void leaveCourse(const Goal& goal, const std::string& left_by);
  std::int64_t stepsTo(const Goal& goal);
  motion::Plan plan(const Goal& goal, std::int64_t at);
  /// @param overshoot [microsteps] @return without an id.
  Move moveOf(const motion::Profile& profile, double overshoot);
  std::int64_t motorTarget(const Goal& goal, const motion::MotionState& from,
                           const motion::MotionLimits& within);
  motion::Profile planStopOf(const Motion& before, std::int64_t at,
                             const motion::MotionState& from) const;
  pulse::Nanoseconds restartInterval() const;
  MoveResult replacedBy(const Motion& motion, std::int64_t began);
  void conclude(const pulse::ChannelState& state);
  MoveResult resultOf(const Motion& motion, const pulse::ChannelState& state);
  std::string standsAt(const Goal& goal, const std::string& why) const;
  std::string endedWith(const Goal& goal) const;

  std::uint64_t serial_ = 0;
  std::uint64_t moves_ = 0;
  std::uint64_t ended_seen_ = 0;
  std::uint64_t line_errors_seen_ = 0;
  std::uint64_t chip_faults_seen_ = 0;
  std::uint64_t input_stops_seen_ = 0;
  std::size_t on_enable_line_ = 0;  // its number there
  std::uint64_t releases_seen_ = 0;
  bool pins_doubtful_ = false;  // a write failed: they may be as wanted or not
  int mode_failed_ = 0;         // the mode whose pins could not all be written; 0: none
};

}  // namespace stepdriver::axis
