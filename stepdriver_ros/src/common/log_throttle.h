#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace stepdriver::ros_node {

/// Lets something be logged at most once in a period of real time, whichever threads ask. The
/// macros ROS_*_THROTTLE keep the time of their last message unprotected: only one thread at a time
/// may come to each of them.
class LogThrottle {
 public:
  using Clock = std::chrono::steady_clock;

  explicit LogThrottle(Clock::duration period) : period_(period.count()) {}

  /// Whether to log it now. Any thread.
  bool isDue() {
    const std::int64_t now = Clock::now().time_since_epoch().count();
    std::int64_t next = next_;
    return now >= next && next_.compare_exchange_strong(next, now + period_);
  }

 private:
  const std::int64_t period_;
  std::atomic<std::int64_t> next_{0};
};

}  // namespace stepdriver::ros_node
