#pragma once

#include "profile.h"

namespace stepdriver::motion {

/// A value of a profile, and the time at which it first occurs.
struct Peak {
  double value = 0.0;
  double time_s = 0.0;  ///< after the profile's start
};

/// The demands of a profile on a motor: a caller with limits can refuse it and say when it would
/// exceed them.
struct ProfilePeaks {
  Peak lowest;        ///< [microsteps]
  Peak highest;       ///< [microsteps]
  Peak velocity;      ///< [microsteps/s] the largest absolute value, with its sign
  Peak acceleration;  ///< [microsteps/s^2] the largest absolute value inside a piece, with its sign
  Peak velocity_jump;  ///< [microsteps/s] the largest sudden change, with its sign: at the start,
                       ///< between two pieces or at the end
};

/// In closed form for each piece; rounding makes jumps of about 2^-50 of the velocity at continuous
/// points.
///
/// @param velocity_before the velocity before the profile [microsteps/s].
/// @param velocity_after the velocity after it [microsteps/s].
ProfilePeaks profilePeaks(const Profile& profile, double velocity_before = 0.0,
                          double velocity_after = 0.0);

/// The peaks of a motion: a profile from `time_s` on [s], and the part before it, whose peaks are
/// `before`.
ProfilePeaks joinPeaks(const ProfilePeaks& before, const ProfilePeaks& part, double time_s);

}  // namespace stepdriver::motion
