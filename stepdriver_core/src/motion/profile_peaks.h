#pragma once

#include "motion/profile.h"

namespace stepdriver::motion {

/// A value of a profile, and when it is first there.
struct Peak {
  double value = 0.0;
  double time_s = 0.0;  ///< after the profile's start
};

/// What a profile asks of a motor, so that one who has limits can refuse it and say when it would
/// break them.
struct ProfilePeaks {
  Peak lowest;         ///< [microsteps]
  Peak highest;        ///< [microsteps]
  Peak velocity;       ///< [microsteps/s] the one furthest from 0, with its sign
  Peak acceleration;   ///< [microsteps/s^2] the one furthest from 0 inside a piece, with its sign
  Peak velocity_jump;  ///< [microsteps/s] the largest change at once, with its sign, be it at the
                       ///< start, between two pieces or at the end
};

/// In closed form for each piece; rounding leaves jumps of some 2^-50 of the velocity where there
/// are none.
///
/// @param velocity_before what the profile takes over from [microsteps/s].
/// @param velocity_after what follows it [microsteps/s].
ProfilePeaks profilePeaks(const Profile& profile, double velocity_before = 0.0,
                          double velocity_after = 0.0);

/// Those of a motion of which one profile is a part from `time_s` on [s], and the other ones are
/// the peaks of what comes before it.
ProfilePeaks joinPeaks(const ProfilePeaks& before, const ProfilePeaks& part, double time_s);

}  // namespace stepdriver::motion
