#pragma once

#include "profile.h"

namespace stepdriver::motion {

/// [microsteps] A motion that passes a position by no more than this makes no step beyond it.
inline constexpr double kNoStep = 0.5;

/// The lowest and the highest position of a motion [microsteps].
struct PositionRange {
  double lowest = 0.0;
  double highest = 0.0;
};

/// It takes time in proportion to the number of pieces.
PositionRange positionRangeOf(const Profile& profile);

/// How far a motion from one position passes a target before it comes back to it [microsteps]; 0 if
/// it makes no step beyond it. From less than half a microstep away, it may pass it on either side.
double overshootOf(const PositionRange& extent, double from, double target);

/// How far a motion passes its own end before it comes back [microsteps]; 0 if it makes no step
/// beyond it.
double overshootOf(const Profile& profile);

}  // namespace stepdriver::motion
