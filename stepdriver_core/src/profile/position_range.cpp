#include "position_range.h"

#include <algorithm>

namespace stepdriver::motion {

PositionRange positionRangeOf(const Profile& profile) {
  const double end = profile.endPosition().value();
  PositionRange extent{end, end};
  const auto consider = [&extent](DoubleDouble position) {
    extent.lowest = std::min(extent.lowest, position.value());
    extent.highest = std::max(extent.highest, position.value());
  };
  for (const Piece& piece : profile.pieces()) {
    consider(piece.p0);
    for (double t = piece.firstTurn(0.0); t < piece.duration.hi; t = piece.firstTurn(t)) {
      consider(piece.positionAt(t));
    }
  }
  return extent;
}

double overshootOf(const PositionRange& extent, double from, double target) {
  const double above = extent.highest - target;
  const double below = target - extent.lowest;
  const double beyond = target - from > kNoStep   ? above
                        : from - target > kNoStep ? below
                                                  : std::max(above, below);
  return beyond > kNoStep ? beyond : 0.0;
}

double overshootOf(const Profile& profile) {
  const PositionRange extent = positionRangeOf(profile);
  const double end = profile.endPosition().value();
  const double way = (profile.endPosition() - profile.startPosition()).value();
  return overshootOf(extent, end - way, end);
}

}  // namespace stepdriver::motion
