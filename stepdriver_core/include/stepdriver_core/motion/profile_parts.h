#pragma once

#include "stepdriver_core/motion/profile.h"

namespace stepdriver::motion {

/// What a profile does between two times after its start [s], from the same start time on. Beyond
/// its end it rests.
Profile part(const Profile& profile, DoubleDouble from, DoubleDouble to);

/// Both motions at once: positions, velocities, accelerations and jerks are the sums. Each rests
/// after its end. Begins when `a` does.
Profile sum(const Profile& a, const Profile& b);

}  // namespace stepdriver::motion
