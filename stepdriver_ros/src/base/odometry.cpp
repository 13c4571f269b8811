#include "odometry.h"

#include <cmath>
#include <cstddef>
#include <utility>

namespace stepdriver::base {
namespace {

// Below it, the chord is shorter than the arc by less than the rounding of a double.
constexpr double kStraight = 1e-8;

/// The length of a chord per length of its arc, sin(x)/x for half of the angle of the arc.
double chordPerArc(double half_angle) {
  return std::abs(half_angle) < kStraight ? 1.0 : std::sin(half_angle) / half_angle;
}

}  // namespace

Pose movedBy(const Pose& pose, const Twist& displacement) {
  const double half_angle = displacement.angular / 2.0;
  const double chord = displacement.linear * chordPerArc(half_angle);
  const double heading = pose.yaw + half_angle;
  return {pose.x + chord * std::cos(heading), pose.y + chord * std::sin(heading),
          pose.yaw + displacement.angular};
}

Odometry::Odometry(Kinematics kinematics) : kinematics_(std::move(kinematics)) {}

void Odometry::moveTo(const std::vector<double>& wheels, double angle) {
  if (!wheels_.empty()) {
    std::vector<double> travels(wheels.size());
    for (std::size_t i = 0; i < wheels.size(); ++i) travels[i] = wheels[i] - wheels_[i];
    pose_ = movedBy(pose_, twistFrom(kinematics_, travels, (angle_ + angle) / 2.0));
  }
  wheels_ = wheels;
  angle_ = angle;
}

}  // namespace stepdriver::base
