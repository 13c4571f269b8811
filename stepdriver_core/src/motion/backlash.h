#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "motion/limits.h"
#include "motion/profile.h"

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

/// A motor's plan for a joint's motion whose first part wasn't known when the rest was planned.
struct JoinedMotor {
  Profile profile;
  /// [s] after the start: what of the profile wasn't planned beforehand. The first is all up to
  /// the tail.
  struct Stretch {
    double from;
    double to;
  };
  std::vector<Stretch> fresh;
  std::optional<double> no_room;  ///< as in MotorPlan
};

/// What a motor does for the tail of a joint's motion, made beforehand: as planMotor() from the
/// first turn on before which all of the backlash was taken up, or none. Never changed once made.
class MotorTail {
 public:
  /// @param joint the tail's, from its own beginning on; outlives this.
  MotorTail(const Profile& joint, std::int64_t backlash, const MotionLimits& limits);
  ~MotorTail();
  MotorTail(const MotorTail&) = delete;
  MotorTail& operator=(const MotorTail&) = delete;

  /// The motor's motion, as if the backlash were taken up already where it first moves.
  const Profile& profile() const { return motor_; }
  /// As in MotorPlan, after the tail's beginning; then nothing can be joined.
  std::optional<double> noRoom() const { return no_room_; }

  /// The plan for a head and the tail. It takes up the backlash from the start on until that
  /// coincides with what was planned beforehand: mostly at the first turn.
  ///
  /// @param own the owner of this, which the profile shares.
  /// @param joint all of the joint's motion, the tail from `begin` [s] on.
  /// @param slack as planMotor().
  /// @return none where the two don't coincide within a bounded number of turns and pieces.
  std::optional<JoinedMotor> join(const std::shared_ptr<const MotorTail>& own,
                                  const std::shared_ptr<const Profile>& joint, DoubleDouble begin,
                                  double slack) const;

 private:
  struct Plan;
  const Profile& joint_;
  std::int64_t backlash_;
  MotionLimits limits_;
  std::unique_ptr<const Plan> plan_;
  Profile motor_;
  std::optional<double> no_room_;
};

}  // namespace stepdriver::motion
