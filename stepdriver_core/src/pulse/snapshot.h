#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace stepdriver::pulse {

/// A value that one thread writes without ever waiting and any thread reads consistently (a
/// sequence lock: a reader that meets a write tries again).
template <typename T>
class Snapshot {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Snapshot() { store(T{}); }

  /// To be called from one thread at a time.
  void store(const T& value) { storeFirst<sizeof(T)>(value); }

  /// Stores only the first bytes of a value: the rest is as it was when it was last stored. From
  /// one thread at a time.
  template <std::size_t kBytes>
  void storeFirst(const T& value) {
    static_assert(kBytes == sizeof(T) || (kBytes < sizeof(T) && kBytes % 8 == 0));
    const std::uint64_t sequence = sequence_.load(std::memory_order_relaxed);
    sequence_.store(sequence + 1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    // Word by word from the original: copying the whole first would double the cost.
    const auto* bytes = reinterpret_cast<const unsigned char*>(&value);
    for (std::size_t i = 0; i < (kBytes + 7) / 8; ++i) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes + 8 * i, std::min<std::size_t>(8, sizeof(T) - 8 * i));
      words_[i].store(word, std::memory_order_relaxed);
    }
    sequence_.store(sequence + 2, std::memory_order_release);
  }

  /// Safe from any thread.
  T load() const {
    std::array<std::uint64_t, kWords> words{};
    std::uint64_t before = 0;
    std::uint64_t after = 0;
    do {
      before = sequence_.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_relaxed);
      std::atomic_thread_fence(std::memory_order_acquire);
      after = sequence_.load(std::memory_order_relaxed);
    } while (before != after || (before & 1) != 0);
    T value;
    std::memcpy(static_cast<void*>(&value), words.data(), sizeof(T));
    return value;
  }

 private:
  static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;

  std::atomic<std::uint64_t> sequence_{0};
  std::array<std::atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace stepdriver::pulse
