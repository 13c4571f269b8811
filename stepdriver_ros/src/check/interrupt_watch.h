#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace stepdriver::check {

/// During its lifetime, waits in a thread for a request to end the program: the signals of
/// ros_node::endSignals().
class InterruptWatch {
 public:
  /// Blocks these signals in this thread and in all threads that it starts from now on.
  static void block();

  /// @return whether one of them arrives in this time; they must be blocked.
  static bool comesWithin(std::chrono::nanoseconds time);

  /// @param act called once, at the first signal, from the waiting thread.
  explicit InterruptWatch(std::function<void()> act);
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;

  bool interrupted() const { return interrupted_; }

 private:
  void watch();

  std::function<void()> act_;
  std::atomic<bool> interrupted_{false};
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

}  // namespace stepdriver::check
