#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::axis {

/// What is known of the inputs: their levels as they were read last, and their last edges.
class InputLevels {
 public:
  explicit InputLevels(std::size_t count) : levels_(count, 0) {}

  /// @return 0 or 1, or -errno if the line could not be read.
  int level(int input) const { return levels_.at(static_cast<std::size_t>(input)); }

  /// @return whether that is another level than before.
  bool take(int input, int level);
  void take(const gpio::EdgeEvent& edge);

  /// The edges of an input after this time, in the order in which they were told.
  std::vector<gpio::EdgeEvent> since(int input, std::int64_t time_ns) const;

 private:
  // Several switches bounce into it, each some dozen times.
  static constexpr std::size_t kRemembered = 512;

  std::vector<int> levels_;
  std::deque<gpio::EdgeEvent> edges_;
};

}  // namespace stepdriver::axis
