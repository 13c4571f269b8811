#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "call.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::activity {

class Context;

/// The lines of the motor power.
struct MotorPowerLines {
  int output = -1;    ///< switches it
  int feedback = -1;  ///< tells whether it is there; -1: not wired
};

/// The power of all motors of a machine: whether it is wanted, the line of its relay, and the only
/// place that knows whether it is there (axis::MachineMode::powered). It has a fault when the line
/// can't be written, or when the feedback doesn't follow it; then it is switched off.
class MotorPower {
 public:
  /// Nothing switches it: it is always there.
  MotorPower() = default;
  /// The line is requested at the level that switches it off.
  MotorPower(const config::MotorPowerConfig& config, const MotorPowerLines& lines)
      : config_(config), lines_(lines), state_(State::kOff), wanted_(false) {}

  bool isWired() const { return config_.has_value(); }
  /// It may be used: its time is over, and the feedback is active, if it is wired.
  bool isThere() const { return state_ == State::kThere; }
  /// It is there, or on its way.
  bool isWanted() const { return wanted_; }
  /// Why it was switched off, or could not be switched on; empty if nothing went wrong.
  const std::string& failure() const { return failure_; }

  /// Switches it on, or keeps it on if it was to be switched off. Its line is switched off first,
  /// in case that failed before.
  void switchOn();
  /// Switches it off at this clock time, or as soon after it as poll() allows.
  ///
  /// @param call is answered when the line is written.
  void switchOff(pulse::Nanoseconds at, const SharedCall& call = {});
  /// Switches it off after an emergency stop.
  void stopped(const Context& context);

  /// Something may have happened.
  ///
  /// @param may_go every brake that can hold its load does, and no motor moves.
  /// @return whether it has got on: others that depend on it must be polled too.
  bool poll(Context& context, bool may_go);
  /// What has gone wrong since the last call; empty: nothing.
  std::string takeFailure();
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  /// Whether it waits for the level of the feedback.
  bool watchesInputs() const;

 private:
  enum class State {
    kOff,
    kLeaving,       ///< off; waits until the feedback says so
    kSwitchingOn,   ///< its line is being written
    kComing,        ///< waits for its time and the feedback
    kThere,         ///< the power is there, or nothing switches it
    kSwitchingOff,  ///< its line is being written
  };
  struct Feedback {
    bool active = false;
    int error = 0;  ///< errno of its line
  };

  /// @return whether it has got to another state.
  bool step(Context& context, bool may_go);
  bool leave(Context& context);
  bool come(Context& context);
  bool watch(Context& context, bool may_go);
  void write(Context& context, bool on);
  bool endWrite(Context& context);
  bool hasFeedback() const { return lines_.feedback >= 0; }
  Feedback feedback(const Context& context) const;
  std::string unreadable(const Context& context, int error) const;
  /// Notes what went wrong, and switches it off. @return true
  bool fail(Context& context, const std::string& why);
  void lose(Context& context);

  std::optional<config::MotorPowerConfig> config_;
  MotorPowerLines lines_;
  State state_ = State::kThere;
  bool wanted_ = true;
  std::optional<pulse::Nanoseconds> off_at_;
  std::vector<SharedCall> off_calls_;
  std::uint64_t job_ = 0;
  pulse::Nanoseconds since_ = 0;  // beginning of the wait of kLeaving or kComing
  pulse::Nanoseconds looked_at_ = 0;
  std::string failure_;
  bool is_news_ = false;  // the failure was not yet taken
};

}  // namespace stepdriver::activity
