#include "edge_queue.h"

#include <algorithm>
#include <chrono>

namespace stepdriver::gpio {

int EdgeQueue::pop(std::int64_t timeout_ns, EdgeEvent* events, std::size_t capacity) {
  std::unique_lock<std::mutex> lock(mutex_);
  const auto come = [this] { return interrupted_ || size_ > 0; };
  if (timeout_ns < 0) {
    changed_.wait(lock, come);
  } else if (timeout_ns > 0) {
    changed_.wait_for(lock, std::chrono::nanoseconds(timeout_ns), come);
  }
  interrupted_ = false;
  const std::size_t count = std::min(size_, capacity);
  for (std::size_t i = 0; i < count; ++i) {
    events[i] = edges_[first_];
    first_ = (first_ + 1) % edges_.size();
  }
  size_ -= count;
  return static_cast<int>(count);
}

}  // namespace stepdriver::gpio
