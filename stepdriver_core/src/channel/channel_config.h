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

/// The most coils of a motor that lines switch.
constexpr std::size_t kCoils = 4;
/// Coils that have current, a bit for each: the first one's is the lowest.
using CoilSet = std::uint8_t;

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
  std::array<Signal, kCoils> coils;  ///< see ChannelConfig::patterns
};

/// An end of an axis.
enum class AxisEnd : std::uint8_t { kMin, kMax };

/// The most motors that an axis can have.
constexpr std::size_t kMostMotors = 4;

/// Motors of an axis, a bit for each: the first motor's is the lowest.
using MotorSet = std::uint8_t;
constexpr MotorSet motorBit(std::size_t motor) { return static_cast<MotorSet>(1U << motor); }

/// Whether the coils of the motors of a channel have current, and for each motor, the number of the
/// pattern that they have then, or would have.
struct CoilCurrent {
  bool on = false;
  std::array<std::uint8_t, kMostMotors> places{};
};

/// [microsteps] One for each motor of an axis.
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
  /// An input that is active, for an instant or longer, when the motor is blocked. It ends motions
  /// that are made until then (Follow::until_block) as kBlocked.
  std::optional<Signal> block;
  /// The fault outputs are such inputs. In these motions that is no fault.
  bool block_is_fault = false;
  /// [microsteps] If endstop_min and endstop_max are one line, which doesn't tell the end that
  /// presses it: the way on which the switch opens for certain. 0: they aren't.
  double switch_release = 0.0;
  std::optional<AxisEnd> assumed_end;  ///< the one that presses that switch if nothing tells
  Nanoseconds in_position_timeout = 0;
  /// `step` makes steps forward, and pulses on `dir`, which is no level then, make steps backward.
  /// dir_setup and dir_hold are kept between the pulses of the two.
  bool dir_steps = false;
  bool both_edges = false;  ///< each edge of `step` is a step
  /// Motors whose coils are switched by lines, MotorSignals::coils, instead of `step` and `dir`:
  /// the coils that have current at each step of an electrical cycle. A step is a write of those
  /// that change. The longer one of step_high and step_low is the shortest time between two. Empty:
  /// the motors have `step` and `dir`.
  std::vector<CoilSet> patterns;
  Nanoseconds step_high = 0;
  Nanoseconds step_low = 0;
  Nanoseconds dir_setup = 0;
  Nanoseconds dir_hold = 0;
  /// [full steps] How late a step may be without putting off all that follow: the motor feels the
  /// angle by which its field is behind the plan, and then returns to it, as at the steps of a
  /// coarser mode. See PulseEngine.
  double late_steps = 0.25;
  /// [microsteps] The motor's way at a reversal before the joint moves. It need not be a whole
  /// number.
  double backlash = 0.0;
};

/// Axes that share motors, as on a CoreXY: each motor moves by a sum of the motions of the axes.
/// The n-th motor has the lines, times and driver chip of the n-th channel; what ends one of the
/// channels early ends all of them.
struct SharedAxes {
  std::vector<std::size_t> channels;
  /// For each motor: [microsteps of the motor] for a microstep of each axis.
  std::vector<std::vector<double>> matrix;
  /// For each axis: [microsteps of the axis] for a microstep of each motor.
  std::vector<std::vector<double>> inverse;
};

}  // namespace stepdriver::pulse
