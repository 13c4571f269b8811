#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::bench {

/// A run against the steady clock.
struct PacedRun {
  int axes = 1;
  double rate = 0.0;         ///< of the first axis [microsteps/s] at 1/16 microsteps
  double seconds = 1.0;      ///< of the motion, with a fifth of it for each of its two ramps
  double late_steps = 0.25;  ///< ChannelConfig::late_steps
};

/// The result of a run against the steady clock.
struct PacedFigures {
  std::size_t edges = 0;  ///< active STEP edges, or wake-ups
  std::vector<pulse::Nanoseconds>
      lateness;             ///< how late each edge was, against the timeline at that time; sorted
  std::uint64_t slips = 0;  ///< number of times that the timeline slid
  pulse::Nanoseconds slipped = 0;               ///< total time by which it slid
  std::size_t too_short = 0;                    ///< pulses and pauses shorter than the chip's time
  std::size_t early = 0;                        ///< steps before their planned time
  pulse::Nanoseconds shortest = pulse::kNever;  ///< between two steps of an axis, or two wake-ups
  double cpu = 0.0;                             ///< part of one core that the whole process took
  double largest_lag = 0.0;  ///< [electrical degrees] of the rotors behind their fields
  std::int64_t lost = 0;     ///< full steps that the rotors lost
  int scheduler_error = -1;  ///< from pulse::RealtimeRights

  pulse::Nanoseconds percentile(double part) const;
};

/// Drives axes on free lines. The rate of each axis is a hundredth below that of the axis before
/// it, so their steps coincide only now and then. What went out then turns the rotors of motors
/// with two fifths of their holding torque as friction and 0.05 of the critical damping.
PacedFigures runPaced(const PacedRun& run);

/// A loop of clock_nanosleep() to absolute times, with the rights of the pulse thread and nothing
/// else in it.
PacedFigures runNanosleep(double rate, double seconds);

/// Keeps all cores busy for as long as this object exists, with one process of ordinary priority
/// per core.
class Load {
 public:
  Load();
  ~Load();
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;

 private:
  std::vector<int> processes_;
};

}  // namespace stepdriver::bench
