#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "motion/profile.h"
#include "motion/profile_peaks.h"

namespace stepdriver::motion {

/// Where a trajectory wants one axis to be at one time, and, where it says so, how fast.
struct Waypoint {
  std::int64_t time_ns = 0;            ///< after the trajectory's start
  double position = 0.0;               ///< [microsteps] within kFarthest of 0
  std::optional<double> velocity;      ///< [microsteps/s]
  std::optional<double> acceleration;  ///< [microsteps/s^2] counts only beside a velocity
};

/// [microsteps] No waypoint is further from 0: whatever a curve does in between stays an integer
/// of 53 bits.
constexpr double kFarthest = 140737488355328.0;  // 2^47

/// [microsteps] How far the cubics of a quintic segment may be from it.
constexpr double kQuinticError = 0.01;

/// One axis of a trajectory: from where the motion is at its start through all waypoints, each at
/// its time to the nanosecond, to rest at the last.
///
/// What both ends of a segment give makes its curve, as in ROS's joint_trajectory_controller:
/// - velocity and acceleration at both: the quintic that has them;
/// - velocity at both, an acceleration at one or none: the cubic that has them;
/// - no velocity at one of them: a straight line, whatever else is given. The velocity jumps at its
///   ends, as profilePeaks() tells.
/// The first segment begins at `from`, which gives all three. A waypoint at time 0 is over when the
/// motion starts: where it is the first of several, it is left out, and `from` stands for it.
///
/// A quintic of duration T is cut into n cubics of h = T/n that have its position and velocity at
/// both ends. They leave it by at most h^4/384 max|p''''|, and n is the smallest that makes this
/// kQuinticError or less; a step comes where the curve is at a half-step line but for that.
/// Position and velocity are continuous; the velocity is off by at most sqrt(3) h^3/216 max|p''''|,
/// the acceleration by h^2/12 max|p''''| <= 32 kQuinticError/h^2, and between two of the cubics it
/// jumps by h^3/15 |p'''''|.
///
/// Each segment starts from its waypoint as given, so that errors don't add up: where two pieces
/// meet, the positions differ by less than 2^-52 of the way in the piece.
///
/// The last waypoint's position is rounded to a whole microstep, halves to even; a velocity there
/// other than 0 ends in a jump to rest.
///
/// @param from finite; its position is within kFarthest of 0.
/// @param waypoints at least one, at times from 0 on that grow from each to the next, all numbers
///   finite.
/// @throw std::invalid_argument for what is not so, naming the waypoint (the first is 0), the value
///   and what is allowed; and where velocities and accelerations lead a curve out of 2^53
///   microsteps.
/// @throw std::range_error where it takes Profile::kLongest or longer.
Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints);

/// What a trajectory asks of a motor that has a jerk limit.
struct SplineJerk {
  Peak jerk;               ///< [microsteps/s^3] the one furthest from 0 in a segment, with its sign
  Peak acceleration_jump;  ///< [microsteps/s^2] the largest change at once, with its sign, be it at
                           ///< the start, at a waypoint or at the end
};

/// Of the curves that planSpline() follows, not of the cubics that it cuts a quintic into: their
/// accelerations jump by as much as makes no difference to the steps.
///
/// @throw as planSpline().
SplineJerk splineJerk(const MotionState& from, const std::vector<Waypoint>& waypoints);

/// A trajectory's way from its first segment's end on, which doesn't depend on where the motion is
/// when it begins: so it can be made beforehand, and joining a motion to it takes the same time
/// however long it is. Never changed once made.
class SplineTail {
 public:
  /// @throw as planSpline().
  explicit SplineTail(const std::vector<Waypoint>& waypoints);

  /// Where the tail begins [s], after the trajectory's start. If there is only one segment, that
  /// ends here.
  double beginS() const { return static_cast<double>(first_.time_ns) * 1e-9; }
  /// What the tail does, from its own beginning on; none if there is only one segment.
  const Profile* profile() const { return profile_ ? &*profile_ : nullptr; }
  /// What it asks of a motor that has a jerk limit, at times after its own beginning. Its end
  /// counts, its beginning doesn't.
  const SplineJerk& jerk() const { return jerk_; }

  /// The first segment. @throw std::invalid_argument as planSpline().
  std::vector<Piece> head(const MotionState& from) const;
  /// What it asks of such a motor, at its beginning and at its end too.
  SplineJerk headJerk(const MotionState& from) const;

 private:
  Waypoint first_;                   // the one that the first segment leads to
  std::size_t first_index_ = 0;      // of it
  double begin_acceleration_ = 0.0;  // of the tail [microsteps/s^2]
  std::optional<Profile> profile_;
  SplineJerk jerk_;
};

}  // namespace stepdriver::motion
