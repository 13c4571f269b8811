#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::axis {

/// The last edges of all inputs, with their times, for whoever wants to know when one happened.
class EdgeLog {
 public:
  /// @param lines outlives the log.
  /// @param watched a thread calls watch(); else whoever asks takes in what has come.
  EdgeLog(gpio::Lines& lines, bool watched) : lines_(lines), watched_(watched) {}

  /// Waits for edges, and keeps them. For one thread at a time.
  ///
  /// @return as Lines::waitForEdges().
  int watch(std::int64_t timeout_ns);

  /// The edges of an input after this time, in the order in which they were told; from any thread.
  std::vector<gpio::EdgeEvent> since(int input, std::int64_t time_ns);

 private:
  gpio::Lines& lines_;
  const bool watched_;
  std::mutex mutex_;
  std::deque<gpio::EdgeEvent> edges_;
};

}  // namespace stepdriver::axis
