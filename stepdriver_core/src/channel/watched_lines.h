#pragma once

#include <atomic>
#include <cerrno>
#include <cstddef>

#include "channel/channel_state.h"
#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::pulse {

/// Lines of which another thread can see for which one the pulse thread waits.
class WatchedLines {
 public:
  /// @param lines outlive this.
  explicit WatchedLines(gpio::Lines& lines) : lines_(lines) {}

  /// @return 0 or an errno.
  int write(const gpio::LineWrite* writes, std::size_t count) {
    output_.store(writes->output, std::memory_order_relaxed);
    input_.store(-1, std::memory_order_relaxed);
    return lines_.write(writes, count);
  }
  /// See gpio::Lines.
  gpio::LateWrites lateWrites(int output) const { return lines_.lateWrites(output); }
  /// @return the level or, below 0, an errno.
  int read(int input) {
    input_.store(input, std::memory_order_relaxed);
    return lines_.read(input);
  }

  /// The line that is at work, or was last; any thread may ask. If that doesn't return, its chip
  /// doesn't answer. The error is ETIMEDOUT.
  LineFailure atWork() const {
    const int input = input_.load(std::memory_order_relaxed);
    if (input >= 0) return {ETIMEDOUT, input, true};
    return {ETIMEDOUT, output_.load(std::memory_order_relaxed)};
  }

 private:
  gpio::Lines& lines_;
  std::atomic<int> output_{-1};
  std::atomic<int> input_{-1};  // -1: an output is
};

}  // namespace stepdriver::pulse
