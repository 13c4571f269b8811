#include "port/pin_ring.h"

namespace stepdriver::pulse {

PinRing::PinRing(const std::vector<bool>& levels, std::size_t edges)
    : levels_(levels.size()), ring_(edges) {
  for (std::size_t i = 0; i < levels.size(); ++i) levels_[i] = levels[i];
}

PinRing::Copy PinRing::copy(Clock& clock) const {
  Copy copy;
  // The levels are copied first: if one of them changes after this, its edge is in the copy.
  for (const std::atomic<bool>& level : levels_) {
    copy.levels.push_back(level.load(std::memory_order_acquire));
  }
  const Nanoseconds last = last_.load(std::memory_order_acquire);
  const auto records = ring_.copy();
  copy.overwritten = records.overwritten;
  // No edge of the copy is later than this.
  const Nanoseconds now = clock.now();
  if (now - last > kLongestPause) return copy;
  constexpr std::uint64_t kTimes = (std::uint64_t{1} << (64 - kTimeShift)) - 1;
  copy.edges.reserve(records.records.size());
  for (const auto& [word] : records.records) {
    const std::uint64_t age = (static_cast<std::uint64_t>(now) - (word >> kTimeShift)) & kTimes;
    copy.edges.push_back({now - static_cast<Nanoseconds>(age),
                          static_cast<int>(word >> 1U & (kMostOutputs - 1)), (word & 1U) != 0});
  }
  return copy;
}

}  // namespace stepdriver::pulse
