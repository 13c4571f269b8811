#pragma once

#include "motion/profile.h"

namespace stepdriver::motion {

/// What a profile does between two times after its start [s], from the same start time on. Beyond
/// its end it rests. Takes O(log n) of the profile's pieces beside those of the part.
Profile part(const Profile& profile, DoubleDouble from, DoubleDouble to);

/// A part of a piece: what it does from `from` on [s], for a time that may go on beyond its end.
Piece partOf(const Piece& piece, DoubleDouble from, DoubleDouble duration);

/// Both motions at once: positions, velocities, accelerations and jerks are the sums. Each rests
/// after its end. Begins when `a` does.
Profile sum(const Profile& a, const Profile& b);

}  // namespace stepdriver::motion
