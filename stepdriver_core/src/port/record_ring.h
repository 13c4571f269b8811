#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stepdriver::pulse {

/// The latest records of one thread, which adds them without ever waiting. Any thread copies them
/// meanwhile: no record in the copy is half of one and half of another.
///
/// Before the writer overwrites old records, it announces a whole block of them. A reader checks
/// this announcement after its copy, and drops what was announced: those records may be torn.
template <std::size_t kWords>
class RecordRing {
 public:
  using Record = std::array<std::uint64_t, kWords>;

  /// A copy, in the order in which the records were added.
  struct Copy {
    std::vector<Record> records;
    bool overwritten = false;  ///< there were older ones
  };

  /// Touches all of its memory.
  /// @param records A copy contains so many records at least, once there were as many.
  explicit RecordRing(std::size_t records)
      : words_((records / kBlock + 2) * kBlock * kWords), capacity_(words_.size() / kWords) {}

  /// To be called from one thread at a time.
  void add(const Record& record) {
    if (added_ % kBlock == 0) beginBlock();
    for (const std::uint64_t word : record) {
      words_[position_++].store(word, std::memory_order_relaxed);
    }
    end_.store(++added_, std::memory_order_release);
  }

  /// Forgets all records. To be called from the thread that adds.
  void clear() { begin_.store(added_, std::memory_order_relaxed); }

  /// Safe from any thread.
  Copy copy() const {
    const std::uint64_t end = end_.load(std::memory_order_acquire);
    const std::uint64_t begin = std::max(begin_.load(std::memory_order_relaxed), oldest(end));
    Copy copy;
    copy.records.resize(static_cast<std::size_t>(end - begin));
    for (std::size_t i = 0; i < copy.records.size(); ++i) {
      const auto slot = static_cast<std::size_t>((begin + i) % capacity_);
      for (std::size_t k = 0; k < kWords; ++k) {
        copy.records[i][k] = words_[slot * kWords + k].load(std::memory_order_relaxed);
      }
    }
    std::atomic_thread_fence(std::memory_order_acquire);
    const std::uint64_t whole = oldest(announced_.load(std::memory_order_relaxed));
    const std::uint64_t torn = std::min(end, std::max(whole, begin)) - begin;
    copy.records.erase(copy.records.begin(),
                       copy.records.begin() + static_cast<std::ptrdiff_t>(torn));
    copy.overwritten = begin + torn > begin_.load(std::memory_order_relaxed);
    return copy;
  }

 private:
  static constexpr std::uint64_t kBlock = 64;

  std::uint64_t oldest(std::uint64_t end) const { return end - std::min(end, capacity_); }

  void beginBlock() {
    if (position_ == words_.size()) position_ = 0;
    announced_.store(added_ + kBlock, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
  }

  std::vector<std::atomic<std::uint64_t>> words_;
  const std::uint64_t capacity_;  // in records; whole blocks
  // Only the writer uses these.
  std::size_t position_ = 0;
  std::uint64_t added_ = 0;

  std::atomic<std::uint64_t> begin_{0};
  std::atomic<std::uint64_t> end_{0};
  std::atomic<std::uint64_t> announced_{0};  // Records before this one may be written now.
};

}  // namespace stepdriver::pulse
