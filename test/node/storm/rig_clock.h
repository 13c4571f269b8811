#pragma once

#include <cstdint>
#include <vector>

namespace stepdriver::storm {

/// The rig's clock, and CLOCK_MONOTONIC before and after it was read. [ns]
struct ClockReading {
  std::int64_t before = 0;
  std::int64_t rig = 0;
  std::int64_t after = 0;
};

/// What the rig's clock can have shown at a time of CLOCK_MONOTONIC. It runs with CLOCK_MONOTONIC;
/// it falls behind while the node plans, is slow or doesn't run, and then catches up.
class RigClock {
 public:
  /// @param readings one after the other, at least one.
  explicit RigClock(std::vector<ClockReading> readings);

  /// The rig's clock shows this or more at this time.
  std::int64_t earliestAt(std::int64_t time) const;
  /// The rig's clock shows this or less at this time.
  std::int64_t latestAt(std::int64_t time) const;
  /// When the rig's clock surely shows this time, or the end of the readings.
  std::int64_t whenItShows(std::int64_t rig) const;

 private:
  std::vector<ClockReading> readings_;
  std::int64_t
      offset_;  // the most by which CLOCK_MONOTONIC can be ahead of a clock that isn't behind
};

}  // namespace stepdriver::storm
