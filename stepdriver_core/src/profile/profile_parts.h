#pragma once

#include "profile.h"

namespace stepdriver::motion {

/// The part of a profile between two times after its start [s], with the same start time. Beyond
/// its end it is at rest. Takes O(log n) of the profile's pieces in addition to those of the part.
Profile part(const Profile& profile, DoubleDouble from, DoubleDouble to);

/// The part of a piece from `from` on [s], for a time that may extend beyond its end.
Piece partOf(const Piece& piece, DoubleDouble from, DoubleDouble duration);

/// Both motions at once: positions, velocities, accelerations and jerks are the sums. Each is at
/// rest after its end. The sum begins when `a` begins.
Profile sum(const Profile& a, const Profile& b);

}  // namespace stepdriver::motion
