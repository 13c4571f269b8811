#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Counts times in buckets of a fixed relative width: sixteen per power of two.
///
/// add() and clear() are for one thread, figures() is for any thread. They never wait, lock or
/// allocate. The figures contain everything that was added before the call; what is added during
/// the call may be missing.
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
  /// @param now, late clock time of a pulse, and its lateness.
  void add(Nanoseconds now, Nanoseconds late);

  LatenessFigures sinceStart() const { return since_start_.figures(); }

  /// For the second before the current one: seconds begin at whole seconds of the clock.
  LatenessFigures lastSecond(Nanoseconds now) const;

 private:
  void begin(std::int64_t second);

  struct Window {
    std::atomic<std::int64_t> second{-1};
    LatenessHistogram histogram;
  };

  LatenessHistogram since_start_;
  // While one is read, the next one is written, and that takes a second.
  std::array<Window, 3> windows_;
  Window* current_ = &windows_[0];
  Nanoseconds current_end_ = 0;
};

}  // namespace stepdriver::pulse
