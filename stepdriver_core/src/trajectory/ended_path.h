#pragma once

#include <cstdint>
#include <string>

namespace stepdriver::motion {

/// A path of several axes that has ended; a request to append to it comes too late.
struct EndedPath {
  std::uint64_t move = 0;  ///< the number of the axis's move along it
  std::string message;     ///< the message of that move's MoveResult
};

/// "it has ended: x stands at 0.01 m, not at 0.02 m: the max endstop was met"
///
/// @param last the last path that ended; nullptr if there is none.
inline std::string howItEnded(const EndedPath* last, std::uint64_t move) {
  if (last != nullptr && last->move == move) return "it has ended: " + last->message;
  return "it has ended before another one, or there was none";
}

}  // namespace stepdriver::motion
