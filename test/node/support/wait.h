#pragma once

#include <chrono>
#include <thread>

namespace stepdriver::node_test {

/// Longer than any successful step takes on a machine that stalls now and then.
constexpr std::chrono::seconds kBound{100};

/// Waits for a condition. @return whether it came true within the bound.
template <typename Condition>
bool waitUntil(const Condition& condition, std::chrono::duration<double> bound = kBound) {
  const auto deadline = std::chrono::steady_clock::now() + bound;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

/// For what needs its time.
inline void sleepFor(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

}  // namespace stepdriver::node_test
