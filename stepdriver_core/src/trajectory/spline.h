#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "profile/profile.h"
#include "profile/profile_peaks.h"
#include "profile/resting_count.h"

namespace stepdriver::motion {

/// The position that a trajectory gives for one axis at one time and, optionally, the velocity.
struct Waypoint {
  std::int64_t time_ns = 0;            ///< after the trajectory's start
  double position = 0.0;               ///< [microsteps] within kFarthest of 0
  std::optional<double> velocity;      ///< [microsteps/s]
  std::optional<double> acceleration;  ///< [microsteps/s^2] counts only together with a velocity
  bool may_rest = false;  ///< the motion may come to rest here, even between two microsteps
};

/// [microsteps] The largest distance of a waypoint from 0. Curves between waypoints then stay
/// within integers of 53 bits.
constexpr double kFarthest = 140737488355328.0;  // 2^47

/// [microsteps] The largest deviation of the cubics from the quintic that they replace.
constexpr double kQuinticError = 0.01;

/// The part of a limit by which the acceleration or the velocity of the cubics may exceed it, if
/// that of their quintic doesn't.
constexpr double kQuinticLimitError = 0.0025;

/// The limits of the axis, which the curve of a trajectory keeps if its points allow that.
struct SplineLimits {
  double acceleration = std::numeric_limits<double>::infinity();  ///< [microsteps/s^2]
  double speed = std::numeric_limits<double>::infinity();         ///< [microsteps/s]
  /// A segment whose curve exceeds a limit by more than this factor gets a gentler one through the
  /// same positions and velocities. Infinity if the velocities aren't the sender's, or if the
  /// acceleration must not jump.
  double gentler_beyond = std::numeric_limits<double>::infinity();
};

/// One axis of a trajectory: from the state at its start through all waypoints, each at its time to
/// the nanosecond, to rest at the last one.
///
/// The curve of a segment depends on what both ends give, as in ROS's joint_trajectory_controller:
/// - velocity and acceleration at both ends: the quintic that has them;
/// - velocity at both ends, an acceleration at one end at most: the cubic that has the velocities;
/// - no velocity at one end: a straight line, whatever else is given. The velocity jumps at its
///   ends, as profilePeaks() reports; interpolate() avoids that. The first segment begins at
///   `from`, which gives all three. A waypoint at time 0 has passed when the motion starts: if it
///   is the first of several, it is left out, and `from` replaces it.
///
/// A quintic of duration T is divided into n cubics of h = T/n that have its position and velocity
/// at both ends. They deviate from it by at most h^4/384 max|p''''|, and n is the smallest number
/// that makes this kQuinticError or less; apart from this, a step comes when the curve crosses a
/// half-step line. Position and velocity are continuous; the velocity is off by at most sqrt(3)
/// h^3/216 max|p''''|, the acceleration by h^2/12 max|p''''| <= 32 kQuinticError/h^2, and between
/// two of the cubics it jumps by h^3/15 |p'''''|. If that takes a cubic above a limit, n is doubled
/// until it doesn't, or until that error is kQuinticLimitError of it.
///
/// A sender's acceleration may jump between two points, as at the corners of a trapezoid of
/// velocity. The quintic through its samples then overshoots by up to 37 %, and the cubic by up to
/// 33 %. With SplineLimits::gentler_beyond, such a segment becomes the cubic if that keeps to the
/// limits, and otherwise the curve whose largest acceleration is the smallest possible one: its
/// velocity changes evenly, stays at the limit of the speed if it comes that far, and changes
/// evenly again. If that exceeds a limit, so does every other curve with these positions and
/// velocities.
///
/// Each segment starts from its waypoint as given, so that errors don't accumulate: where two
/// pieces meet, the positions differ by less than 2^-52 of the piece's distance.
///
/// It ends at the restingCount() of the last waypoint, or there if it may_rest; a velocity there
/// other than 0 ends in a jump to rest.
///
/// @param from finite; its position is within kFarthest of 0.
/// @param waypoints at least one, at increasing times from 0 on, all numbers finite.
/// @param limits those of the axis.
/// @throw motion::Malformed if these conditions don't hold, naming the waypoint (the first is
///   0), the value and what is allowed; and if velocities and accelerations lead a curve out of
///   2^53 microsteps.
/// @throw motion::TooLong if it takes Profile::kLongest or longer.
Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints, const SplineLimits& limits = {});

/// The demands of a trajectory on a motor with a jerk limit, without
/// SplineLimits::gentler_beyond.
struct SplineJerk {
  Peak jerk;  ///< [microsteps/s^3] the largest absolute value in a segment, with its sign
  Peak acceleration_jump;  ///< [microsteps/s^2] the largest sudden change, with its sign: at the
                           ///< start, at a waypoint or at the end
};

/// For the curves that planSpline() follows, not for the cubics into which it divides a quintic:
/// their jumps in acceleration make no difference to the steps.
///
/// @throw as planSpline().
SplineJerk splineJerk(const MotionState& from, const std::vector<Waypoint>& waypoints);

/// A trajectory from the end of its first segment on. It doesn't depend on the position at the
/// start, so it can be made in advance, and joining a motion to it takes the same time however long
/// it is. Immutable.
class SplineTail {
 public:
  /// @throw as planSpline().
  explicit SplineTail(const std::vector<Waypoint>& waypoints, const SplineLimits& limits = {});

  /// [s] The time after the trajectory's start at which the tail begins. If there is only one
  /// segment, it is the end of that segment.
  double beginS() const { return static_cast<double>(first_.time_ns) * 1e-9; }
  /// The motion of the tail, from its own beginning on; null if there is only one segment.
  const Profile* profile() const { return profile_ ? &*profile_ : nullptr; }
  /// The demands of the tail on a motor with a jerk limit, at times after its own beginning. They
  /// include its end, but not its beginning.
  const SplineJerk& jerk() const { return jerk_; }

  /// The first segment. @throw motion::Malformed as planSpline().
  std::vector<Piece> head(const MotionState& from) const;
  /// The demands of the first segment on such a motor, including its beginning and end.
  SplineJerk headJerk(const MotionState& from) const;

 private:
  SplineLimits limits_;
  Waypoint first_;                   // the end of the first segment
  std::size_t first_index_ = 0;      // the index of its end
  double begin_acceleration_ = 0.0;  // [microsteps/s^2] at the beginning of the tail
  std::optional<Profile> profile_;
  SplineJerk jerk_;
};

}  // namespace stepdriver::motion
