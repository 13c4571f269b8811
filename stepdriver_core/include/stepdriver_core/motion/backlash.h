#pragma once

#include <cstdint>
#include <optional>

#include "stepdriver_core/motion/limits.h"
#include "stepdriver_core/motion/profile.h"

namespace stepdriver::motion {

/// What a motor does so that a joint behind a backlash makes a motion.
struct MotorPlan {
  Profile profile;
  /// [s] after the start: where the joint turns with so much speed, acceleration or jerk after it
  /// that the limits leave nothing to take the backlash up with. The profile is then the joint's.
  std::optional<double> no_room;
};

/// The joint's motion and, upon that, what takes the backlash up: all of it on a way up, none of it
/// on a way down. From where the joint has come to its last turning point on, that is moved to as
/// fast as the limits leave room beside the joint's own speed, acceleration and jerk in that time,
/// which is when the joint lags behind. Turns of less than half a microstep are none: no step comes
/// of them.
///
/// @param joint [microsteps] from its own start on. The motor's begins then too, and ends when that
///   ends, or later: when the backlash is taken up.
/// @param slack [microsteps] of the backlash, what is taken up at the start: from 0 to all.
/// @param limits of the motor; its deceleration isn't looked at, as a motor that speeds up on one
///   side of the backlash slows down on the other.
MotorPlan planMotor(const Profile& joint, double slack, std::int64_t backlash,
                    const MotionLimits& limits);

}  // namespace stepdriver::motion
