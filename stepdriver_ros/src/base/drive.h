#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "kinematics.h"

namespace stepdriver::base {

/// The state of an axis of the base, from the driver.
struct AxisReport {
  std::string trouble;  ///< why it can't drive; empty: it can
  bool moving = false;
};

/// What to send now.
struct DriveOrders {
  /// [unit/s] of all wheels; empty: send nothing, so that others can move them.
  std::vector<double> wheels;
  std::optional<double> steering;  ///< [rad] a new target of the steering
};

/// Decides what the wheels do: from commands, from the states of its axes, and from time.
///
/// It ramps all wheels together, so that the ratio of their velocities is that of the command. If
/// an axis can't drive, if the driver is silent, or if a wheel stands that should turn, all wheels
/// stop. After that it takes no command until the cause is over and the commands have paused for
/// their timeout or one was 0.
///
/// It has no clock: times are seconds on any clock that never goes back.
class Drive {
 public:
  struct Timeouts {
    double command = 0.5;  ///< [s] without a command until the base comes to rest
    double driver = 0.5;   ///< [s] without a report until the wheels stop
  };
  enum class State {
    kReady,    ///< takes commands
    kStopped,  ///< there is a cause that stops all wheels
    kWaiting   ///< the cause is over, but commands have neither paused nor been 0
  };

  /// @param wheels names of the axes, in the order of the kinematics.
  /// @param steering name of the axis; used if the kinematics have a steering.
  /// @param driver name of the driver, for messages.
  Drive(Kinematics kinematics, std::vector<std::string> wheels, std::string steering,
        std::string driver, Timeouts timeouts);

  /// @param wanted finite numbers.
  void command(const Twist& wanted, double now);
  /// @param wheels in the order of the kinematics.
  /// @param steering has a meaning only if the base has a steering.
  void report(const std::vector<AxisReport>& wheels, const AxisReport& steering, double now);
  /// The driver's factor of all velocities. It is multiplied after the commands, and above 1 the
  /// driver limits each wheel by itself.
  void speedOverrideIs(double factor) { speed_override_ = factor; }
  /// The current angle of the steering [rad].
  void steeringIsAt(double angle) { angle_ = angle; }
  /// The driver has refused or failed to take the target of the steering.
  void steeringRefused(const std::string& why) { steering_refused_ = why; }

  /// What to send now. Call it regularly.
  DriveOrders orders(double now);
  /// What to send at the end of the program: rest, if the wheels were told otherwise.
  DriveOrders rest();

  State state() const { return state_; }
  /// Why all wheels have stopped, or stopped last.
  const std::string& cause() const { return cause_; }
  /// Whether a command has ended by the timeout since the last call.
  bool takeTimedOut();
  /// Whether a command turned more tightly than the steering can since the last call.
  bool takeTooTight();

 private:
  std::string findCause(double now);
  std::string standingAxis(double now);
  void updateState(double now);
  void timeOut(double now);
  DriveOrders stopOrders(double now);
  DriveOrders driveOrders(double seconds);
  /// Turns the steering, and returns the speed that its wheel should have meanwhile.
  double steer(DriveOrders& orders);
  void tell(DriveOrders& orders, std::vector<double> velocities);

  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  const Kinematics kinematics_;
  const std::vector<std::string> names_;
  const std::string steering_name_;
  const std::string driver_;
  const Timeouts timeouts_;

  Twist wanted_;
  double commanded_at_ = kNever;
  bool timed_out_ = false;
  bool too_tight_ = false;

  std::vector<AxisReport> reports_;
  AxisReport steering_report_;
  double reported_at_ = kNever;
  double speed_override_ = 1.0;
  double angle_ = 0.0;
  std::optional<double> target_;  // the last target of the steering
  std::string steering_refused_;

  State state_ = State::kStopped;
  std::string cause_;
  double stopped_at_ = kNever;
  double asked_at_ = kNever;
  Twist twist_;               // what the last orders drive, without a steering
  double speed_ = 0.0;        // [m/s] the same with a steering
  std::vector<double> told_;  // [unit/s] to the wheels; empty: rest, and they were told
  // Since when an axis stands that should turn, in the order of the wheels; the last is the
  // steering.
  std::vector<std::optional<double>> stands_since_;
};

}  // namespace stepdriver::base
