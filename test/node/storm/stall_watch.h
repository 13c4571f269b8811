#pragma once

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "storm/oracle.h"

namespace stepdriver::storm {

/// Notes when this computer doesn't run a thread that is ready to run, from the lateness of a
/// thread's short sleeps.
class StallWatch {
 public:
  StallWatch()
      : thread_([this] {
          while (!ended_) {
            const std::int64_t begin = steadyNow();
            std::this_thread::sleep_for(kSleep);
            const std::int64_t end = steadyNow();
            if (end - begin < kStall) continue;
            const std::lock_guard<std::mutex> lock(mutex_);
            stalls_.push_back({begin, end});
          }
        }) {}
  ~StallWatch() {
    ended_ = true;
    thread_.join();
  }
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

  std::vector<Stall> stalls() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stalls_;
  }

 private:
  static constexpr std::chrono::milliseconds kSleep{5};
  static constexpr std::int64_t kStall = 40'000'000;  // [ns]

  std::atomic<bool> ended_{false};
  mutable std::mutex mutex_;
  std::vector<Stall> stalls_;
  std::thread thread_;
};

}  // namespace stepdriver::storm
