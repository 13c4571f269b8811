#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace stepdriver::test {

/// Waits until it is true, for a minute at most. @return whether it is true.
inline bool within(const std::function<bool()>& true_now) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!true_now()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace stepdriver::test
