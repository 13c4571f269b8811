#pragma once

#include "motor_lines.h"
#include "pin_sequence.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::motor {

/// The brake of an axis: its line, and the only place that knows whether it is engaged.
class Brake {
 public:
  /// The line is requested at the level that engages the brake.
  Brake(const config::AxisConfig& config, const MotorLines& lines)
      : config_(config.brake.value_or(config::BrakeConfig{})), line_(lines.brake) {}

  bool isWired() const { return line_ >= 0; }
  /// The line has the level that engages it; settles() tells when it holds the load.
  bool isEngaged() const { return state_ == State::kEngaged; }
  /// The line has the level that releases it, or may have it.
  bool isReleased() const { return state_ == State::kReleased; }
  /// Clock time at which its mechanics have followed the last write of its line.
  pulse::Nanoseconds settles() const { return settles_; }

  /// @name The write of its line. The time of the mechanics is not part of it, because the chip's
  ///   fault line counts meanwhile.
  /// @{
  PinSequence engage() const { return writeOf(!config_.release_level); }
  PinSequence release() const { return writeOf(config_.release_level); }
  /// @}

  /// A line of the axis was written. @param now clock time after the write
  void noteWritten(int line, bool level, pulse::Nanoseconds now) {
    if (!isWired() || line != line_) return;
    const bool releases = level == config_.release_level;
    state_ = releases ? State::kReleased : State::kEngaged;
    settles_ = now + (releases ? config_.release_ns : config_.engage_ns);
  }
  /// A write of a line of the axis has failed. If it was to release the brake, it may have done so.
  void noteFailed(int line, bool level) {
    if (!isWired() || line != line_) return;
    state_ = level == config_.release_level ? State::kReleased : State::kUnknown;
  }

 private:
  enum class State {
    kEngaged,
    kReleased,
    kUnknown,  ///< it could not be engaged
  };

  PinSequence writeOf(bool level) const {
    PinSequence sequence;
    sequence.add(line_, level, 0);
    return sequence;
  }

  const config::BrakeConfig config_;
  const int line_;
  State state_ = State::kEngaged;
  pulse::Nanoseconds settles_ = 0;
};

}  // namespace stepdriver::motor
