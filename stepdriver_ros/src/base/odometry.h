#pragma once

#include <vector>

#include "kinematics.h"

namespace stepdriver::base {

/// Place and heading of the base, in the frame in which it began.
struct Pose {
  double x = 0.0;    ///< [m]
  double y = 0.0;    ///< [m]
  double yaw = 0.0;  ///< [rad] counts whole turns
};

/// The pose at the end of an arc: the exact integral of a motion whose linear and angular velocity
/// have a constant ratio.
///
/// @param displacement [m] along the arc, [rad] around z.
Pose movedBy(const Pose& pose, const Twist& displacement);

/// The pose of a base from the positions of its wheels. It doesn't drift while the wheels stand
/// still, and the yaw of a base with wheels on both sides depends only on their current positions.
class Odometry {
 public:
  explicit Odometry(Kinematics kinematics);

  /// Integrates the travel since the last call as one arc. A steering counts with the mean of its
  /// angles then and now.
  ///
  /// @param wheels [unit] positions of the wheels' axes, in the order of the kinematics.
  /// @param angle [rad] of the steering, if there is one.
  void moveTo(const std::vector<double>& wheels, double angle);

  /// The next positions are those of the current pose, whatever they are.
  void forgetPositions() { wheels_.clear(); }

  const Pose& pose() const { return pose_; }

 private:
  const Kinematics kinematics_;
  Pose pose_;
  std::vector<double> wheels_;  // empty: not known
  double angle_ = 0.0;
};

}  // namespace stepdriver::base
