#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "input.h"

namespace stepdriver::machine {

/// The levels of all inputs, as one thread read them.
struct InputReading {
  std::uint64_t number = 0;  ///< a reading with a higher number began later
  std::vector<int> levels;   ///< each input's level: 0 or 1, or -errno
};

/// What the controller was told of the inputs, which several threads read. Not safe from several
/// threads.
class ToldLevels {
 public:
  explicit ToldLevels(std::size_t inputs) : levels_(inputs, 0) {}

  /// @return what to tell it of this reading: the levels that differ from those that it was told;
  ///   nothing of a reading that began before one of which it was told.
  std::vector<InputRead> differences(const InputReading& reading) {
    std::vector<InputRead> changed;
    if (reading.number < number_) return changed;
    number_ = reading.number;
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      if (levels_[i] == reading.levels[i]) continue;
      levels_[i] = reading.levels[i];
      changed.push_back({static_cast<int>(i), levels_[i]});
    }
    return changed;
  }

 private:
  std::uint64_t number_ = 0;
  std::vector<int> levels_;
};

}  // namespace stepdriver::machine
