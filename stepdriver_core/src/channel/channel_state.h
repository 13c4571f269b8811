#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "channel/channel_config.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

enum class EndReason {
  kDone,
  kEndstopMin,
  kEndstopMax,
  kEmergencyStop,
  kChipFault,      ///< the chip's fault line became active
  kTooLate,        ///< a pulse came too late to continue at this speed
  kLineError,      ///< a line could not be written or read
  kNotInPosition,  ///< the in-position output didn't become active in time
  kCompanion,      ///< another channel of the group was ended
  kSkewed,         ///< motors that square got too far apart: those that still move met no switch
  kBlocked,        ///< the motor was reported to be blocked, see ChannelConfig::block
};

/// A write or a read that failed.
struct LineFailure {
  int error = 0;       ///< errno; 0: no failure
  int line = -1;       ///< by its index in the gpio::Lines
  bool input = false;  ///< true: it was read; false: it was written
};

/// The state of a channel.
struct ChannelState {
  /// @name All that a step changes, if the axis has one motor
  /// @{
  std::int64_t count = 0;  ///< [microsteps] active STEP edges forward minus those backward
  /// The part of the backlash that is taken up towards max, as the nearest whole number: from 0 to
  /// all of it. The position of the joint is count minus this.
  std::int64_t slack = 0;
  std::uint64_t pulses = 0;  ///< active STEP edges
  Nanoseconds rose = 0;      ///< clock time by which the last active STEP edge had happened
  /// @}
  double taken_up = 0.0;        ///< [microsteps] at rest: the exact part of the backlash, see slack
  std::uint64_t taken = 0;      ///< serial of the last command that was handled
  std::uint64_t accepted = 0;   ///< serial of the last command that was not refused
  std::uint64_t following = 0;  ///< serial of the current profile; 0: at rest
  std::uint64_t ended = 0;      ///< serial of the last profile that ended
  EndReason end = EndReason::kDone;
  LineFailure failure;       ///< the last one
  Nanoseconds end_time = 0;  ///< motion time at which it ended
  bool end_abrupt = false;   ///< it ended at a speed that the motor can't stop from at once
  /// At rest: the end that presses the switch that both ends share, if it is active. Empty: it
  /// isn't known.
  std::optional<AxisEnd> pressed;
  MotorSet still = 0;  ///< the motors that make no steps in this motion, or the last one
  std::uint8_t chip_at_fault = 0;  ///< the motor whose chip has reported the last of chip_faults
  std::uint8_t unsettled = 0;      ///< the motor that kNotInPosition is about
  Nanoseconds waited = 0;  ///< how long it waited for the in-position output before kNotInPosition
  Nanoseconds end_lateness = 0;   ///< how late the pulse was that was not sent, for kTooLate
  std::uint64_t epoch = 0;        ///< how many times the scale of `count` has changed
  std::uint64_t chip_faults = 0;  ///< how many times the fault line became active
  std::uint64_t line_errors = 0;  ///< failed writes and reads
  Nanoseconds ready = 0;          ///< clock time before which no step goes out
  /// For each motor: its own edges forward minus those backward, less `count`. 0 for motors that
  /// have made every step of the axis.
  MotorCounts lags{};
  /// @name Of an axis that shares motors: `count` is the whole microstep nearest to its place
  ///   by the motors' edges, and `pulses` and `rose` are those of the motor with its chip
  /// @{
  double between = 0.0;   ///< [microsteps] that place minus count
  double rests_at = 0.0;  ///< [microsteps] where a motion from rest begins
  std::int64_t own = 0;   ///< [microsteps] edges of the motor with its chip, forward minus backward
  /// @}

  std::uint64_t faults() const { return chip_faults + line_errors; }
};

/// The beginning of a ChannelState that a step of an axis with one motor changes.
constexpr std::size_t kStepBytes = offsetof(ChannelState, taken_up);

}  // namespace stepdriver::pulse
