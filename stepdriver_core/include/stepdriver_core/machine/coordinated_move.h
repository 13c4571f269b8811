#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::machine {

/// An accepted motion of several axes.
///
/// @code{.cpp}
/// const machine::CoordinatedMove line = machine.moveLine({{"x", "y"}, {0.05, 0.02}});  // [m]
/// std::cout << "it takes " << line.duration << " s\n";
/// std::cout << machine.wait(line).message << "\n";  // "all axes reached their targets"
/// @endcode
struct CoordinatedMove {
  /// The part of one axis in it.
  struct Member {
    std::string axis;
    axis::Move move;
  };
  std::vector<Member> members;  ///< in the order of the request
  double duration = 0.0;        ///< [s] as planned
  /// For Machine::appendPath(); never the same twice.
  std::uint64_t id() const { return members.front().move.id; }
};

/// How and where a motion of several axes ended.
struct CoordinatedResult {
  /// How it ended: kReached, or what ended it first.
  axis::MoveEnd end = axis::MoveEnd::kReached;
  std::string message;            ///< a sentence that says how, and names the axis that ended it
  std::vector<double> positions;  ///< [unit] where the members stand
  double duration = 0.0;          ///< [s] the time that it took
  std::uint64_t marks_made = 0;   ///< as those of its members
  std::uint64_t marks_not_made = 0;
  bool marks_known = true;  ///< whether those of all its members are
};

/// How such a motion ended, from how each of its axes ended it: for a move that outlived its
/// machine, whose axis::Move::outcome are still there.
CoordinatedResult combinedResult(const std::vector<axis::MoveResult>& members);

}  // namespace stepdriver::machine
