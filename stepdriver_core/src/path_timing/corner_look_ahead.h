#pragma once

#include <vector>

#include "line_motion.h"

namespace stepdriver::motion {

/// A line from one corner of a path to the next one.
struct LineBetweenCorners {
  double length = 0.0;  ///< [unit] with both corners
  /// [unit] How much of it belongs to the corners at its begin and at its end if they are rounded.
  double in_first = 0.0;
  double in_last = 0.0;
  LineLimits limits;
};

/// A corner that is passed at a constant speed.
struct RoundedCorner {
  double length = 0.0;  ///< [unit]
  double speed = 0.0;   ///< [unit/s] the highest constant one within the limits of the axes
};

/// The speeds at which a motion along lines from rest to rest passes their corners, by dynamic
/// programming over a few speeds at each corner: a stop, the highest constant speed at which the
/// corner can be passed and two lower ones. No speed changes in a corner, and each line has the
/// fastest motion between the speeds at its ends (see planLine()).
///
/// The motion is no slower than one with a stop at each corner. It takes time in proportion to the
/// number of lines.
///
/// @param corners one less than lines.
/// @return [unit/s] 0: it stops there, and the corner isn't rounded.
std::vector<double> cornerSpeeds(const std::vector<LineBetweenCorners>& lines,
                                 const std::vector<RoundedCorner>& corners);

}  // namespace stepdriver::motion
