#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace stepdriver::pulse {

/// A queue from one thread to another; neither ever waits for the other.
template <typename T, std::size_t kCapacity>
class Mailbox {
 public:
  /// @return false if it is full; nothing was added then.
  bool push(const T& item) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == kCapacity) return false;
    items_[tail % kCapacity] = item;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// @return the oldest item, or nullptr if it is empty. The item stays valid until pop().
  const T* front() const {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return nullptr;
    return &items_[head % kCapacity];
  }

  /// @pre front() was not nullptr.
  void pop() { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

 private:
  std::array<T, kCapacity> items_{};
  std::atomic<std::size_t> head_{0};
  std::atomic<std::size_t> tail_{0};
};

}  // namespace stepdriver::pulse
