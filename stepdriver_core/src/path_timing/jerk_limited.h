#pragma once

#include <vector>

#include "acceleration_limited.h"
#include "geometry/path.h"

namespace stepdriver::motion {

/// A motion along a path to rest at its end, within the limits of the axes, including their
/// jerk, and the speeds of the segments.
///
/// The axes move on the quintics that have the positions, velocities and accelerations of the knots
/// at both ends. In the whole of each quintic, velocities, accelerations and jerks are within the
/// limits, apart from rounding.
///
/// Between two stops, the motion is a moving average of a faster one (see movingAverage()): only
/// its time is changed, so it stays on the path. The faster one is planned as by
/// planAccelerationLimited(), with these changes, where T is the time of the average:
/// - Its speed is also limited by the jerk |q'''(s)| s'^3 and by the acceleration |q''(s)| s'^2,
///   and these limits c count within c T/2 of the place: the average is within c then.
/// - |q'(s)| s'' is limited by T times the jerk limit.
/// - Each of its highest speeds lasts T or longer, so that s'' doesn't change its sign in between.
///
/// So the motion is the fastest one with these limits, a constant speed for T at each of its lowest
/// and highest speeds, and no more than T of them. On a straight line these are the seven phases of
/// the fastest motion with a jerk limit. On a curve, a jerk contains 3 q'' s' s'' and the averages
/// of accelerations in different directions: quintics that exceed a limit lower the speed there and
/// the acceleration in the part of the motion that is averaged, and it is planned again. What is
/// left after some rounds slows the part between the two stops down as a whole. The best of these
/// rounds and of several T is taken.
///
/// If a corner would have to be passed so slowly that a stop takes less time, the motion stops
/// there, and the corner isn't rounded (PathTiming::stops): no motion takes longer than with a
/// stop at each corner.
///
/// A section from rest to rest that won't be continued takes the optimum that is found from this
/// average, if it is faster (see OptimalMotion).
///
/// A section from rest along lines whose corners are rounded one by one needs no average if it
/// won't be continued: each line has the fastest motion from one speed to another, and each corner
/// a constant speed, which a look-ahead chooses (see cornerSpeeds()). On a straight line this is
/// the optimum.
///
/// If it begins at a speed v and an acceleration a, the average first contains a motion at the
/// acceleration a which lasted for T and whose mean place, speed and acceleration are those of the
/// begin: it ended v T/2 + a T^2/12 after the begin, at the speed v + a T/2. So the jerk may jump
/// there, but nothing else does, and T needn't be that of the motion so far. The faster motion can
/// do from there whatever was planned if the one so far had the acceleration a for the last T:
/// those knots may be begins of other paths. Each of its highest and lowest speeds has one.
///
/// @param path with a continuous curvature. @param limits one for each axis, at least one with a
///   jerk limit.
/// @param begin its acceleration isn't 0 only if its speed isn't.
/// @return not all knots if it begins at a speed from which it needs more than a limit.
/// @throw motion::TooLong if it takes Profile::kLongest or longer.
PathTiming planJerkLimited(const Path& path, const std::vector<TimingLimits>& limits,
                           const TimingStart& begin = {});

}  // namespace stepdriver::motion
