#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/path.h"

namespace stepdriver::motion {

/// The limits of one axis on a path. All are above 0, and all but the jerk are finite [unit/s,
/// unit/s^2].
struct TimingLimits {
  double speed = 0.0;
  double acceleration = 0.0;                              ///< while its speed rises
  double deceleration = 0.0;                              ///< while its speed falls
  double jerk = std::numeric_limits<double>::infinity();  ///< [unit/s^3] infinity: no limit
};

/// A place of a path, the time at which the motion is there, and its velocity.
struct TimingKnot {
  std::int64_t time_ns = 0;
  std::size_t segment = 0;
  std::vector<double> positions;   ///< [unit]
  std::vector<double> velocities;  ///< [unit/s]
  /// [unit/s^2] Empty if accelerations may jump.
  std::vector<double> accelerations;
  double parameter = 0.0;     ///< the parameter of the segment there
  double speed = 0.0;         ///< [unit/s] along the path
  double acceleration = 0.0;  ///< [unit/s^2] along the path; 0 if accelerations may jump
  /// Another path can begin here: no corner before it is being rounded, or if accelerations may
  /// not jump, the state of the motion here allows all that has been planned for the time after it.
  bool may_begin = false;
  double average = 0.0;  ///< [s] the time over which planJerkLimited() averaged
  /// On the way to the next knot, that knot's segment is straight, and the acceleration is
  /// constant.
  bool straight = false;
};

/// The place and the speed at which a motion along a path begins.
struct TimingStart {
  double parameter = 0.0;  ///< the parameter of the first segment there
  double speed = 0.0;      ///< [unit/s] along the path
  /// @name Ignored if accelerations may jump
  /// @{
  double acceleration = 0.0;  ///< [unit/s^2] along the path
  double average = 0.0;       ///< [s] of the motion so far; 0: unknown
  /// @}
  /// [s] How long ago the motion was exactly there; less than half a nanosecond.
  double ago = 0.0;
  /// [s] Of the motion so far, from which times are counted, and by which they are rounded. Ignored
  /// if accelerations may jump.
  double before = 0.0;
};

/// The motion along a path.
struct PathTiming {
  std::vector<TimingKnot> knots;  ///< the first one is at time 0 and at the begin of the path
  /// Up to this time the motion is also the fastest one if the path continues at its end,
  /// however its corner there is rounded.
  std::int64_t settled_ns = 0;
  /// The segments at whose end the motion stops because rounding the corner would take longer, in
  /// increasing order.
  std::vector<std::size_t> stops;
  /// The largest part of a limit that the motion uses if that is more than 1: if it begins at a
  /// speed, it can't be slowed down as a whole.
  double excess = 1.0;
};

/// The fastest motion along a path to rest at its end, within the limits of the axes and the
/// speeds of the segments. Jerk limits are ignored: accelerations jump. See
/// planJerkLimited().
///
/// The axes move on the cubics that have the positions and velocities of the knots at both ends.
/// Between knots they are within a tenth of the resolution of the path. In the whole of each
/// cubic, velocities and accelerations are within the limits, apart from rounding.
///
/// The path is divided at places between which its direction turns by little, and straight parts
/// aren't divided. With x = s'^2 as a function of the length s, the limits are linear in x and s'':
///
///     -a <= q'(s) s'' + q''(s) x <= a,   q'(s)^2 x <= v^2
///
/// A pass from the end computes the largest x at each place from which the motion can still be
/// slowed down, a pass from the start the largest of these that the motion can reach (H. Pham and
/// Q.-C. Pham, A new approach to time-optimal path parameterization based on reachability analysis,
/// 2018). On straight parts the motion is an exact trapezoid.
///
/// On curves, an axis that accelerates at its limit does so evenly, and s'' changes on the way. So
/// what is limited between two places is the mean of an axis's acceleration, and the time of the
/// cubic is chosen with which its accelerations keep to the limits at both ends. If there is no
/// such time, because the axis at its limit changes or turns on the way, the interval is divided,
/// and the limits hold at both ends of its parts with a constant s''. That makes the motion slower,
/// so these are divided further if they are long.
///
/// A motion that is as fast as possible is at one of its limits at every time: intervals in which
/// it isn't are divided, and so are those whose cubic would deviate. Limits that a cubic exceeds
/// are then lowered there, and the passes are repeated. If an excess is left, a motion from rest is
/// slowed down by that factor as a whole.
///
/// @param limits one for each axis.
/// @return no knots if it begins at a speed from which it needs 1 % more than a limit, or at a
/// stop.
/// @throw motion::TooLong if it takes Profile::kLongest or longer.
PathTiming planAccelerationLimited(const Path& path, const std::vector<TimingLimits>& limits,
                                   const TimingStart& begin = {});

}  // namespace stepdriver::motion
