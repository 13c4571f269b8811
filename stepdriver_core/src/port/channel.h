#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// A line by its index in the gpio::Lines, and its active level.
struct Signal {
  int line = -1;
  bool active = true;
};

/// The lines of a motor of an axis.
struct MotorSignals {
  Signal step;
  Signal dir;  ///< active: forward, the count rises
  std::optional<Signal> endstop_min;
  std::optional<Signal> endstop_max;
  std::optional<Signal> fault;  ///< the chip's fault output
  /// The driver's in-position output: a motion that settles (Follow::settles) ends when it is
  /// active, on every motor that has one. If one isn't within the timeout after the end of the
  /// profile, the motion ends as kNotInPosition.
  std::optional<Signal> in_position;
};

/// The most motors that an axis can have.
constexpr std::size_t kMostMotors = 4;

/// Motors of an axis, a bit for each: the first motor's is the lowest.
using MotorSet = std::uint8_t;
constexpr MotorSet motorBit(std::size_t motor) { return static_cast<MotorSet>(1U << motor); }

/// [microsteps] By motor of an axis.
using MotorCounts = std::array<std::int32_t, kMostMotors>;

/// [microsteps] How far apart some motors are that were square with other counts.
inline std::int64_t skewOf(const MotorCounts& now, const MotorCounts& square, std::size_t motors) {
  std::int64_t least = 0;
  std::int64_t most = 0;
  for (std::size_t i = 0; i < motors; ++i) {
    const std::int64_t moved = std::int64_t{now[i]} - square[i];
    least = i == 0 ? moved : std::min(least, moved);
    most = i == 0 ? moved : std::max(most, moved);
  }
  return most - least;
}

/// What the engine needs to know about an axis: its first motor, and all else.
struct ChannelConfig : MotorSignals {
  /// Further motors, at most kMostMotors - 1: they step in the same write as the first one, with
  /// the same times, unless the motion leaves them out (Follow::still).
  std::vector<MotorSignals> twins;
  /// [microsteps] While the motors square (Follow::squares), how far apart the counts of two may
  /// get since they were square.
  std::int64_t max_skew = 0;
  /// A fault doesn't end a motion that has made a step: it is only counted, and a stop is expected.
  bool ramps_at_fault = false;
  Nanoseconds in_position_timeout = 0;
  /// `step` makes steps forward, and pulses on `dir`, which is no level then, make steps backward.
  /// dir_setup and dir_hold are kept between the pulses of the two.
  bool dir_steps = false;
  bool both_edges = false;  ///< each edge of `step` is a step
  Nanoseconds step_high = 0;
  Nanoseconds step_low = 0;
  Nanoseconds dir_setup = 0;
  Nanoseconds dir_hold = 0;
  /// [full steps] How late a step may be without putting off all that follow: the motor feels the
  /// angle by which its field is behind the plan, and then returns to it, as at the steps of a
  /// coarser mode. See PulseEngine.
  double late_steps = 0.25;
  /// [microsteps] Of the motor at a reversal before the joint moves. It need not be a whole number.
  double backlash = 0.0;
};

/// Axes that share motors, as on a CoreXY: each motor moves by a sum of the motions of the axes.
/// The n-th motor has the lines, times and driver chip of the n-th channel; what ends one of the
/// channels early ends all of them.
struct SharedAxes {
  std::vector<std::size_t> channels;
  /// By motor: [microsteps of the motor] for a microstep of each axis.
  std::vector<std::vector<double>> matrix;
  /// By axis: [microsteps of the axis] for a microstep of each motor.
  std::vector<std::vector<double>> inverse;
};

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
  MotorSet still = 0;        ///< the motors that make no steps in this motion, or the last one
  std::uint8_t chip_at_fault = 0;  ///< the motor whose chip has reported the last of chip_faults
  std::uint8_t unsettled = 0;      ///< the motor that kNotInPosition is about
  Nanoseconds waited = 0;          ///< for the in-position output, before kNotInPosition
  Nanoseconds end_lateness = 0;    ///< of the pulse that was not sent, for kTooLate
  std::uint64_t epoch = 0;         ///< how many times the scale of `count` has changed
  std::uint64_t chip_faults = 0;   ///< how many times the fault line became active
  std::uint64_t line_errors = 0;   ///< failed writes and reads
  Nanoseconds ready = 0;           ///< clock time before which no step goes out
  /// By motor: its own edges forward minus those backward, less `count`. 0 for motors that have
  /// made every step of the axis.
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
