#pragma once

#include <vector>

#include "profile/profile.h"
#include "spline.h"

namespace stepdriver::motion {

/// Moves the waypoints next to the ends of a trajectory by up to half a microstep, so that it ends
/// on a whole microstep, and begins at the place of the axis if its first waypoint rounds to that.
///
/// An axis rests on whole microsteps, but a sender's points lie anywhere between them. If the
/// difference d at an end were left to the segment there, it would add an acceleration of 6 d/t^2,
/// which may exceed the limit if the points are a short time t apart. It is spread over a longer
/// time W instead, along the quintic from rest to rest, whose acceleration is at most 5.8 d/W^2 and
/// whose jerk is at most 60 d/W^3. W is the time that keeps these below a thousandth of the limits,
/// or the whole trajectory if that is shorter: on a way of 72 microsteps from rest to rest it is
/// then 1 % of the acceleration, and less on a longer one.
///
/// @param from the state at time 0; only a place at rest counts.
/// @param waypoints those that requireWaypoints() accepts. Velocities and accelerations that they
///   don't give stay empty.
/// @param acceleration, jerk the limits of the axis [microsteps/s^2, /s^3]; 0: no jerk limit.
std::vector<Waypoint> shiftedToMicrosteps(const MotionState& from, std::vector<Waypoint> waypoints,
                                          double acceleration, double jerk);

}  // namespace stepdriver::motion
