#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "point_to_point/motion_limits.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// A motor's motion that lets the joint behind a backlash make a given motion.
struct MotorPlan {
  Profile profile;
  /// [s] The time after the start of a reversal after which the limits leave no room to take up the
  /// backlash, because the joint has so much speed, acceleration or jerk. The profile is then the
  /// joint's.
  std::optional<double> no_room;
};

/// The joint's motion plus the motion that takes up the backlash: all of the backlash is taken up
/// while the joint moves up, nothing while it moves down. From the joint's last turning point on,
/// the added motion is as fast as the limits allow in addition to the joint's own speed,
/// acceleration and jerk in that time; the joint lags behind until it is done. Reversals of less
/// than half a microstep are ignored: they make no step.
///
/// @param joint [microsteps] from its own start on. The motor's motion begins at the same time. It
///   ends at the same time or later, when the backlash is taken up.
/// @param slack [microsteps] the part of the backlash that is taken up at the start: from 0 to all.
/// @param limits the motor's. The deceleration is ignored, because a motor that speeds up on one
///   side of the backlash slows down on the other.
/// @param taken [microsteps] the part that is taken up in fact, if it isn't `slack`: the joint lags
///   behind its motion, because the turns before the start were shorter than the backlash. It is
///   brought to its end all the same.
MotorPlan planMotor(const Profile& joint, double slack, std::int64_t backlash,
                    const MotionLimits& limits, std::optional<double> taken = {});

/// The part of a backlash that is taken up at a time of a motor's motion [microsteps]. It is empty
/// if the motion before that doesn't determine it: the motor turned so little, or so often.
std::optional<double> slackAt(const Profile& motor, std::int64_t time_ns, std::int64_t backlash);

/// A motor's plan for a joint's motion whose first part was unknown when the rest was planned.
struct JoinedMotor {
  Profile profile;
  /// A part of the profile that wasn't planned in advance, in [s] after the start. The first one is
  /// everything up to the tail.
  struct Stretch {
    double from;
    double to;
  };
  std::vector<Stretch> fresh;
  std::optional<double> no_room;  ///< as in MotorPlan
};

/// A motor's motion for the tail of a joint's motion, planned in advance as planMotor() would plan
/// it. It begins at the first reversal at which the backlash is certainly taken up completely or
/// not at all. Immutable.
class MotorTail {
 public:
  /// @param joint the tail of the joint's motion, from its own beginning on. It outlives this.
  MotorTail(const Profile& joint, std::int64_t backlash, const MotionLimits& limits);
  ~MotorTail();
  MotorTail(const MotorTail&) = delete;
  MotorTail& operator=(const MotorTail&) = delete;

  /// The motor's motion, as if the backlash were already taken up when it first moves.
  const Profile& profile() const { return motor_; }
  /// As in MotorPlan, in the time after the tail's beginning. If it is set, nothing can be joined.
  std::optional<double> noRoom() const { return no_room_; }

  /// The plan for a head and the tail. It takes up the backlash from the start on until the result
  /// coincides with the tail's plan, mostly at the first reversal.
  ///
  /// @param own the owner of this, which the profile shares.
  /// @param joint the joint's whole motion, with the tail from `begin` [s] on.
  /// @param slack as for planMotor().
  /// @return empty if the two don't coincide within a bounded number of reversals and pieces.
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
