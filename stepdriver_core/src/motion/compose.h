#pragma once

#include <memory>

#include "motion/profile.h"

namespace stepdriver::motion {

/// What one axis does on a straight line while the path is run through: origin + scale * path.
/// Exact but for the rounding of the pieces' accelerations and jerks to doubles; the profiles of
/// one path begin and end at the same nanosecond.
///
/// @param origin [microsteps of the axis]
/// @param scale [microsteps of the axis/unit of the path]
Profile scaled(const Profile& path, DoubleDouble origin, DoubleDouble scale);

/// What one axis does on a curve q(s) while s runs as `path` says: q(s(t)).
///
/// If s runs at a constant rate this is exact, and an excerpt of the course: that takes the same
/// time and memory however long it is. If the rate changes, s(t) is a parabola or a cubic, and
/// q(s(t)) has a degree of up to 9; it is cut into cubics of h that have its position and velocity
/// at both ends, which leave it by at most h^4/384 max|d^4 q/dt^4| <= kComposeError, with
/// d^4 q/dt^4 = 6 q''' s'^2 s'' + q'' (3 s''^2 + 4 s' s''').
///
/// @param course q(s), with s in seconds from its start; it moves.
/// @param path s(t), in seconds: from 0 to the course's duration, never backwards.
Profile composeAlong(const std::shared_ptr<const Profile>& course, const Profile& path);

/// [microsteps]
constexpr double kComposeError = 0.01;

/// What a motor may be asked for.
struct MotorBounds {
  double acceleration = 0.0;  ///< [microsteps/s^2]
  double jerk = 0.0;          ///< [microsteps/s^3] 0: no limit
};

/// Whether q(s(t)) keeps to limits wherever the rate changes; elsewhere it is the course itself,
/// run through more slowly or as it is. Looked at nine times in each part that is one polynomial,
/// with its ends; between these it may go beyond the limits by less than a hundredth.
/// Costs nothing for the parts of the path at a constant rate.
bool staysWithin(const Profile& course, const Profile& path, const MotorBounds& bounds);

}  // namespace stepdriver::motion
