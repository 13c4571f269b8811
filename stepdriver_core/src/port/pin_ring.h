#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "port/record_ring.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The latest edges of outputs, 8 bytes each. One thread at a time adds, without waiting or
/// allocating; any thread copies.
class PinRing {
 public:
  /// Outputs have numbers below this.
  static constexpr std::size_t kMostOutputs = 2048;
  /// Edges before a pause as long as this are forgotten: their times would become ambiguous.
  static constexpr Nanoseconds kLongestPause = 3'600'000'000'000;

  struct Edge {
    Nanoseconds time = 0;
    int output = 0;
    bool level = false;
  };

  /// What was recorded until the copy was made.
  struct Copy {
    std::vector<Edge> edges;
    bool overwritten = false;  ///< there were older edges
    std::vector<bool> levels;  ///< all outputs; one without an edge keeps its level
  };

  /// @param levels The levels of all outputs at the beginning.
  /// @param edges A copy contains so many edges at least, once there were as many.
  PinRing(const std::vector<bool>& levels, std::size_t edges);

  /// An output was written. Nothing is recorded if it had this level already.
  ///
  /// @param time at which the write had ended; it doesn't decrease.
  void add(int output, bool level, Nanoseconds time) {
    std::atomic<bool>& known = levels_[static_cast<std::size_t>(output)];
    if (known.load(std::memory_order_relaxed) == level) return;
    addChange(output, level, time);
  }
  /// Records an edge of an output that others write too, whatever level is known here.
  void addChange(int output, bool level, Nanoseconds time) {
    if (time - last_.load(std::memory_order_relaxed) > kLongestPause) ring_.clear();
    ring_.add({static_cast<std::uint64_t>(time) << kTimeShift |
               static_cast<std::uint64_t>(output) << 1U | static_cast<std::uint64_t>(level)});
    last_.store(time, std::memory_order_release);
    levels_[static_cast<std::size_t>(output)].store(level, std::memory_order_release);
  }

  /// @param clock of the times that were added.
  Copy copy(Clock& clock) const;

 private:
  static constexpr unsigned kTimeShift = 12;

  std::vector<std::atomic<bool>> levels_;
  RecordRing<1> ring_;
  std::atomic<Nanoseconds> last_{0};  // time of the last edge
};

}  // namespace stepdriver::pulse
