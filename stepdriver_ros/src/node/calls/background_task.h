#pragma once

#include <functional>
#include <future>
#include <mutex>
#include <utility>

namespace stepdriver::ros_node {

/// Does one job at a time in a thread of its own, for calls that are answered before the job has
/// ended. The destructor waits for it. Safe from any thread.
class BackgroundTask {
 public:
  /// @param check throws if it can't be done now.
  /// @param job must not throw.
  void start(const std::function<void()>& check, std::function<void()> job) {
    const std::lock_guard<std::mutex> lock(mutex_);
    check();
    // The check would have thrown if the previous job were still running.
    job_ = std::async(std::launch::async, std::move(job));
  }

 private:
  std::mutex mutex_;
  std::future<void> job_;
};

}  // namespace stepdriver::ros_node
