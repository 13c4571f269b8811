#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::axis {

/// The last readings of the inputs, and their last edges.
class InputLevels {
 public:
  explicit InputLevels(std::size_t count) : levels_(count, 0) {}

  /// @return 0 or 1, or -errno if the line could not be read.
  int level(int input) const { return levels_.at(static_cast<std::size_t>(input)); }

  /// @return whether the level has changed.
  bool update(int input, int level);
  void add(const gpio::EdgeEvent& edge);

  /// The edges of an input after this time, in the order of their reports.
  std::vector<gpio::EdgeEvent> since(int input, std::int64_t time_ns) const;

  /// All edges that the lines had reported by this time have been added.
  void edgesAddedUntil(std::int64_t time_ns) { added_until_ = std::max(added_until_, time_ns); }
  std::int64_t edgesAddedUntil() const { return added_until_; }

 private:
  // Room for several bouncing switches with some dozen edges each.
  static constexpr std::size_t kRemembered = 512;

  std::vector<int> levels_;
  std::deque<gpio::EdgeEvent> edges_;
  std::int64_t added_until_ = 0;
};

}  // namespace stepdriver::axis
