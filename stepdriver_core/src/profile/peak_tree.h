#pragma once

#include <cstddef>
#include <vector>

#include "profile.h"

namespace stepdriver::motion {

/// The highest absolute values of a motion over some time [microsteps].
struct Highest {
  double speed = 0.0;
  double acceleration = 0.0;
  double jerk = 0.0;
};

Highest highestOf(const Piece& piece);
Highest larger(const Highest& a, const Highest& b);

/// Finds the highest values of a profile over any time, in O(log n) of its pieces.
class PeakTree {
 public:
  /// @param profile outlives the tree.
  explicit PeakTree(const Profile& profile);

  /// @param from, to [s] after the profile's start; from < to. Beyond its end the profile is at
  ///   rest.
  Highest between(DoubleDouble from, DoubleDouble to) const;

 private:
  Highest ofPieces(std::size_t begin, std::size_t end) const;

  const Profile& profile_;
  std::size_t leaves_;
  std::vector<Highest> nodes_;  // node i has the children 2 i and 2 i + 1; the root is 1
};

}  // namespace stepdriver::motion
