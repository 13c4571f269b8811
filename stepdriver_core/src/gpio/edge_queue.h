#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::gpio {

/// Edges of simulated inputs on their way to the waiting thread. Like the kernel's queue, it keeps
/// a few and then loses the oldest. Safe from any thread.
class EdgeQueue {
 public:
  void add(const EdgeEvent& edge) {
    const std::lock_guard<std::mutex> lock(mutex_);
    edges_[(first_ + size_) % edges_.size()] = edge;
    if (size_ < edges_.size()) {
      ++size_;
    } else {
      first_ = (first_ + 1) % edges_.size();
    }
    changed_.notify_one();
  }

  void interrupt() {
    const std::lock_guard<std::mutex> lock(mutex_);
    interrupted_ = true;
    changed_.notify_one();
  }

  /// @return as Lines::waitForEdges().
  int pop(std::int64_t timeout_ns, EdgeEvent* events, std::size_t capacity);

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::array<EdgeEvent, 64> edges_{};
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  bool interrupted_ = false;
};

}  // namespace stepdriver::gpio
