#include "storm/rig_clock.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace stepdriver::storm {
namespace {

/// How far above the smallest offset that was read the true one can't be.
constexpr std::int64_t kOffsetError = 2'000'000;

}  // namespace

RigClock::RigClock(std::vector<ClockReading> readings)
    : readings_(std::move(readings)), offset_(std::numeric_limits<std::int64_t>::max()) {
  for (const ClockReading& reading : readings_) {
    offset_ = std::min(offset_, reading.after - reading.rig);
  }
}

std::int64_t RigClock::earliestAt(std::int64_t time) const {
  const auto next =
      std::partition_point(readings_.begin(), readings_.end(),
                           [time](const ClockReading& reading) { return reading.after <= time; });
  return next == readings_.begin() ? std::numeric_limits<std::int64_t>::min()
                                   : std::prev(next)->rig;
}

std::int64_t RigClock::latestAt(std::int64_t time) const {
  const std::int64_t not_behind = time - offset_ + kOffsetError;
  const auto next =
      std::partition_point(readings_.begin(), readings_.end(),
                           [time](const ClockReading& reading) { return reading.before < time; });
  return next == readings_.end() ? not_behind : std::min(not_behind, next->rig);
}

std::int64_t RigClock::whenItShows(std::int64_t rig) const {
  const auto next =
      std::partition_point(readings_.begin(), readings_.end(),
                           [rig](const ClockReading& reading) { return reading.rig < rig; });
  return next == readings_.end() ? readings_.back().after : next->after;
}

}  // namespace stepdriver::storm
