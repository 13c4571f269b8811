#pragma once

#include <functional>
#include <future>
#include <mutex>
#include <utility>

namespace stepdriver::ros_node {

/// Does one thing at a time in a thread of its own, for calls that are answered before it is over.
/// Its destructor waits for that. Safe from any thread.
class BackgroundTask {
 public:
  /// @param check throws where it can't be done now.
  /// @param job must not throw.
  void start(const std::function<void()>& check, std::function<void()> job) {
    const std::lock_guard<std::mutex> lock(mutex_);
    check();
    // Where the one before is still under way, that is what the check has found.
    job_ = std::async(std::launch::async, std::move(job));
  }

 private:
  std::mutex mutex_;
  std::future<void> job_;
};

}  // namespace stepdriver::ros_node
