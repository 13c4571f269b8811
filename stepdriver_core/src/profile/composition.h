#pragma once

#include <memory>

#include "profile.h"

namespace stepdriver::motion {

/// The motion of one axis on a straight line: origin + scale * path. It is exact except that the
/// pieces' accelerations and jerks are rounded to doubles; the profiles of one path begin and end
/// at the same nanosecond.
///
/// @param origin [microsteps of the axis]
/// @param scale [microsteps of the axis/unit of the path]
Profile scaled(const Profile& path, DoubleDouble origin, DoubleDouble scale);

/// The motion of one axis on a curve q(s) while s follows `path`: q(s(t)).
///
/// If s runs at a constant rate this is exact, and an excerpt of the curve, which takes the same
/// time and memory however long it is. If the rate changes, s(t) is a parabola or a cubic, and
/// q(s(t)) has a degree of up to 9. It is divided into cubics of duration h that have its position
/// and velocity at both ends, and deviate from it by at most h^4/384 max|d^4 q/dt^4| <=
/// kComposeError, with d^4 q/dt^4 = 6 q''' s'^2 s'' + q'' (3 s''^2 + 4 s' s''').
///
/// @param curve q(s), with s in seconds from its start; it moves.
/// @param path s(t), in seconds: from 0 to the curve's duration, never backwards.
Profile composeAlong(const std::shared_ptr<const Profile>& curve, const Profile& path);

/// [microsteps]
constexpr double kComposeError = 0.01;

/// The limits of a motor in microsteps.
struct MotorBounds {
  double acceleration = 0.0;  ///< [microsteps/s^2]
  double jerk = 0.0;          ///< [microsteps/s^3] 0: no limit
};

/// Whether q(s(t)) respects the limits while the rate changes; elsewhere the motion is the curve
/// itself, at full speed or slower. Each polynomial part is examined at nine points, including its
/// ends; between them the motion may exceed the limits by less than a hundredth. The parts of the
/// path at a constant rate cost nothing.
bool staysWithin(const Profile& curve, const Profile& path, const MotorBounds& bounds);

}  // namespace stepdriver::motion
