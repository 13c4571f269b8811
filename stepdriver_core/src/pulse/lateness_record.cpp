#include "pulse/lateness_record.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::pulse {
namespace {

constexpr unsigned kBitsOfBucket = 4;  // sixteen buckets per power of two
constexpr Nanoseconds kLongest = (Nanoseconds{1} << 36) - 1;
constexpr Nanoseconds kSecond = 1'000'000'000;

void addOne(std::atomic<std::uint64_t>& count) {
  // There is only one writer, so the addition needn't be atomic.
  count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

std::size_t LatenessHistogram::bucketOf(Nanoseconds time) {
  const auto value = static_cast<std::uint64_t>(std::clamp<Nanoseconds>(time, 0, kLongest));
  if (value < 2U << kBitsOfBucket) return value;
  const auto shift = static_cast<unsigned>(63 - __builtin_clzll(value)) - kBitsOfBucket;
  return (static_cast<std::size_t>(shift) << kBitsOfBucket) + (value >> shift);
}

Nanoseconds LatenessHistogram::longestIn(std::size_t bucket) {
  if (bucket < 2U << kBitsOfBucket) return static_cast<Nanoseconds>(bucket);
  const std::size_t shift = (bucket >> kBitsOfBucket) - 1;
  const auto mantissa = static_cast<Nanoseconds>(bucket - (shift << kBitsOfBucket));
  return ((mantissa + 1) << shift) - 1;
}

void LatenessHistogram::add(Nanoseconds time) {
  addOne(counts_[bucketOf(time)]);
  if (time > max_.load(std::memory_order_relaxed)) max_.store(time, std::memory_order_relaxed);
}

void LatenessHistogram::clear() {
  for (auto& count : counts_) count.store(0, std::memory_order_relaxed);
  max_.store(0, std::memory_order_relaxed);
}

LatenessFigures LatenessHistogram::figures() const {
  std::array<std::uint64_t, kBuckets> counts{};
  LatenessFigures figures;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    counts[i] = counts_[i].load(std::memory_order_relaxed);
    figures.count += counts[i];
  }
  figures.max = max_.load(std::memory_order_relaxed);
  const auto at = [&](double part) {
    const double rank = std::ceil(part * static_cast<double>(figures.count));
    std::uint64_t passed = 0;
    for (std::size_t i = 0; i < kBuckets; ++i) {
      passed += counts[i];
      if (passed > 0 && static_cast<double>(passed) >= rank) {
        return std::min(longestIn(i), figures.max);
      }
    }
    return figures.max;
  };
  figures.p50 = at(0.5);
  figures.p99 = at(0.99);
  figures.p999 = at(0.999);
  return figures;
}

void LatenessRecord::add(Nanoseconds now, Nanoseconds late) {
  if (now >= current_end_) begin(now / kSecond);
  since_start_.add(late);
  current_->histogram.add(late);
}

void LatenessRecord::begin(std::int64_t second) {
  current_ = &windows_[static_cast<std::size_t>(second) % windows_.size()];
  current_end_ = (second + 1) * kSecond;
  current_->second.store(-1, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  current_->histogram.clear();
  current_->second.store(second, std::memory_order_release);
}

LatenessFigures LatenessRecord::lastSecond(Nanoseconds now) const {
  const std::int64_t second = now / kSecond - 1;
  if (second < 0) return {};
  const Window& window = windows_[static_cast<std::size_t>(second) % windows_.size()];
  if (window.second.load(std::memory_order_acquire) != second) return {};
  const LatenessFigures figures = window.histogram.figures();
  // A reader that needs more than a second for this gets outdated figures.
  std::atomic_thread_fence(std::memory_order_acquire);
  return window.second.load(std::memory_order_relaxed) == second ? figures : LatenessFigures{};
}

}  // namespace stepdriver::pulse
