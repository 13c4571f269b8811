#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::bench {

/// What edges against the steady clock were like.
struct PacedFigures {
  std::size_t edges = 0;                     ///< active STEP edges, or wake-ups
  std::vector<pulse::Nanoseconds> lateness;  ///< of each, against the timeline of then; sorted
  std::uint64_t slips = 0;                   ///< times that the timeline was slid
  pulse::Nanoseconds slipped = 0;            ///< by how much altogether
  std::size_t too_short = 0;                 ///< pulses and pauses shorter than the chip's time
  std::size_t too_close = 0;  ///< steps closer than pulse::PulseEngine::kClosest of their interval
  double cpu = 0.0;           ///< of one core, of the whole process
  int scheduler_error = -1;   ///< from pulse::RealtimeRights

  pulse::Nanoseconds percentile(double part) const;
};

/// Drives axes on lines that cost nothing, each at a rate of its own, a hundredth below that of the
/// axis before it, so that their steps come together now and then and apart else.
///
/// @param rate of the first axis [steps/s]
PacedFigures runPaced(int axes, double rate, double seconds);

/// A loop of clock_nanosleep() to absolute times, with the rights of the pulse thread and nothing
/// else in it.
PacedFigures runNanosleep(double rate, double seconds);

/// Keeps all cores busy for as long as it lives, with a process of ordinary priority for each.
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
