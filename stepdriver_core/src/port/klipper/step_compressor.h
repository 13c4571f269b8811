#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stepdriver::klipper {

/// Steps with intervals that change evenly: the firmware plays the first one `interval` ticks after
/// the step before it, and the interval grows by `add` after each step.
struct StepRun {
  std::uint32_t interval = 0;
  std::uint16_t count = 0;
  std::int16_t add = 0;
};

/// The tick of the i-th step of a run (from 1 on), by the formula of the firmware.
std::int64_t tickOf(const StepRun& run, std::int64_t before, std::uint32_t i);

/// Makes runs of steps whose ticks are given, with an error of at most some ticks for each.
///
/// Each run is the longest possible one. A run (I, A) passes all steps if, for each step i,
/// lo_i <= i I + A i (i - 1)/2 <= hi_i: for each A that is an interval of I, and few A are left
/// after the first two steps. So the search is exact, in whole numbers, and has no fit whose
/// rounding would have to be checked.
class StepCompressor {
 public:
  /// @param error [ticks] at least 0.
  explicit StepCompressor(std::int64_t error);

  /// @param before the tick at which the step before them is played, as the last run has it.
  /// @param ticks of the next steps, in order, each later than `before` and than the one before it
  ///   by more than twice the error.
  /// @param[out] run the longest run that plays the first of them. @pre count > 0
  /// @return how many steps it plays.
  std::size_t next(std::int64_t before, const std::int64_t* ticks, std::size_t count, StepRun& run);

 private:
  // An A, and the I that pass all steps so far.
  struct Candidate {
    std::int64_t add;
    std::int64_t least;
    std::int64_t most;
  };

  const std::int64_t error_;
  std::vector<Candidate> candidates_;
  std::vector<Candidate> next_;
};

/// Whether a run plays these steps within the error: a replay in the firmware's own 32 bits.
bool plays(const StepRun& run, std::int64_t before, const std::int64_t* ticks, std::int64_t error);

}  // namespace stepdriver::klipper
