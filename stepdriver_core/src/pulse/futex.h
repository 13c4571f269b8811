#pragma once

#include <atomic>
#include <cstdint>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Sleeps while the word has this value: until the time of CLOCK_MONOTONIC, a call of wakeSleeper()
/// or a signal. It may return early.
void sleepOnWord(Nanoseconds time, std::atomic<std::uint32_t>& word, std::uint32_t value) noexcept;

/// Wakes one thread that sleeps on the word. It waits for nobody and allocates nothing: for the
/// pulse thread.
void wakeSleeper(std::atomic<std::uint32_t>& word) noexcept;

/// A flag on which one thread sleeps until others raise it.
class WakeFlag {
 public:
  /// Safe from any thread; it waits for nobody.
  void raise() noexcept {
    if (word_.exchange(1, std::memory_order_acq_rel) == 0) wakeSleeper(word_);
  }

  /// Lowers it. @return whether it was raised.
  bool consume() noexcept { return word_.exchange(0, std::memory_order_acq_rel) != 0; }

  /// Returns when it is raised, or at this time of CLOCK_MONOTONIC, and lowers it. For one thread.
  void wait(Nanoseconds until) noexcept;

 private:
  std::atomic<std::uint32_t> word_{0};
};

}  // namespace stepdriver::pulse
