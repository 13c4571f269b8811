#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Counts times in buckets of a fixed width relative to the time: sixteen to each power of two.
///
/// add() and clear() are for one thread, figures() is for any: none of them waits, locks or
/// allocates. What is added while it reads is in the figures or not, all that came before is.
class LatenessHistogram {
 public:
  /// @param time 0 or more; from a minute on it counts as a minute.
  void add(Nanoseconds time);
  void clear();
  LatenessFigures figures() const;

 private:
  static constexpr std::size_t kBuckets = 528;

  static std::size_t bucketOf(Nanoseconds time);
  static Nanoseconds longestIn(std::size_t bucket);

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<Nanoseconds> max_{0};
};

/// The lateness of pulses since the start, and over the last second. Threads as in
/// LatenessHistogram.
class LatenessRecord {
 public:
  /// @param now, late clock time of a pulse, and by how much it was late.
  void add(Nanoseconds now, Nanoseconds late);

  LatenessFigures sinceStart() const { return since_start_.figures(); }

  /// Of the second before the one that `now` is in: seconds begin at whole ones of the clock.
  LatenessFigures lastSecond(Nanoseconds now) const;

 private:
  void begin(std::int64_t second);

  struct Window {
    std::atomic<std::int64_t> second{-1};
    LatenessHistogram histogram;
  };

  LatenessHistogram since_start_;
  // While one is read the next one is written, and there is a second until that is over.
  std::array<Window, 3> windows_;
  Window* current_ = &windows_[0];
  Nanoseconds current_end_ = 0;
};

}  // namespace stepdriver::pulse
