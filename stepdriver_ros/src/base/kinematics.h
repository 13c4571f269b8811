#pragma once

#include <optional>
#include <vector>

namespace stepdriver::base {

/// Motion of the base's origin in its own plane: a velocity in m/s and rad/s, or a displacement in
/// m and rad. The origin is the middle of the axle of the wheels that don't steer, or of the four
/// wheels. x points forwards, y to the left, and angles grow counter-clockwise (REP 103).
struct Twist {
  double linear = 0.0;   ///< [m/s|m] along x
  double angular = 0.0;  ///< [rad/s|rad] around z
};

/// A driven wheel. A unit is that of its axis: m on a linear axis, rad on a rotary one.
struct Wheel {
  double y = 0.0;             ///< [m] from the origin to the left; 0 in the middle
  bool steered = false;       ///< it is the wheel that steers, at the distance of the wheelbase
  double travel = 1.0;        ///< [m/unit] of the ground below it: 1, or the wheel's radius
  double max_speed = 0.0;     ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2]
  double deceleration = 0.0;  ///< [unit/s^2]
};

/// The wheel in front that steers. Its axis is at 0 straight ahead, and positive to the left.
struct Steering {
  double wheelbase = 0.0;  ///< [m] from the origin forwards to the steered wheel
  double max_angle = 0.0;  ///< [rad] to either side, at most a quarter of a revolution
};

/// The wheels and their places: the one description of differential drives, which have wheels on
/// both sides, and of tricycles, which have a steering.
struct Kinematics {
  std::vector<Wheel> wheels;
  std::optional<Steering> steering;
};

/// What a tricycle does for a twist.
struct SteeredMotion {
  double angle = 0.0;  ///< [rad] the angle of the steering
  double speed = 0.0;  ///< [m/s] the speed of the steered wheel along its heading
  bool exact = true;   ///< false: the steering can't turn that far, so the turn is wider
};

/// The steering for a velocity. If the turn is too tight for it, the linear velocity is kept and
/// the curvature is the highest possible. A turn on the spot is then standstill.
SteeredMotion steeredMotion(const Steering& steering, const Twist& wanted);

/// The velocity of a tricycle whose steered wheel has this speed [m/s] at this angle [rad].
Twist twistOf(const Steering& steering, double speed, double angle);

/// Inverse kinematics: the velocities [unit/s] of the wheels, without slip.
///
/// @param angle [rad] of the steering, if there is one.
std::vector<double> wheelVelocities(const Kinematics& kinematics, const Twist& twist, double angle);

/// Forward kinematics: the twist from what the wheels do. Wheels on both sides are enough, whatever
/// the steering does; of several on one side, this is the mean (least squares). Otherwise the angle
/// of the steering counts.
///
/// @param wheels [unit/s|unit] velocities, or small travels while the angle is constant.
Twist twistFrom(const Kinematics& kinematics, const std::vector<double>& wheels, double angle);

/// The largest factor up to 1 by which all velocities must be scaled so that no wheel exceeds its
/// maximum. One factor for all wheels keeps the curvature.
double speedFactor(const Kinematics& kinematics, const std::vector<double>& velocities);

/// How much of a change of velocities is possible in some time, so that no wheel exceeds its
/// acceleration or deceleration. One fraction for all wheels keeps their ratio on the way from rest
/// and to rest.
///
/// @param seconds of the change.
/// @return from 0 to 1.
double changeFraction(const Kinematics& kinematics, const std::vector<double>& from,
                      const std::vector<double>& to, double seconds);

}  // namespace stepdriver::base
