#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace stepdriver::check {

/// Waits in a thread for what asks a program to end, for as long as it lives: the signals of
/// ros_node::endSignals().
class InterruptWatch {
 public:
  /// Blocks these signals in this thread and in those that it starts from now on.
  static void block();

  /// @return whether one of them comes in this time; they are blocked.
  static bool comesWithin(std::chrono::nanoseconds time);

  /// @param act called once, at the first of them, from the thread that waits.
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
