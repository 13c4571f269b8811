#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "follow_joint_trajectory.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::ros_node {

/// How far the joints may deviate from a trajectory. The numbers are in the units of the joints and
/// in the order of the goal; infinite if there is no limit.
struct TrajectoryTolerances {
  std::vector<double> path;
  std::vector<double> goal;
  std::vector<double> path_velocity;
  std::vector<double> goal_velocity;
  double goal_time = 0.0;  ///< [s]
};

/// @throw BadTrajectory for a joint that isn't part of the trajectory, and for NaN.
TrajectoryTolerances readTolerances(const action_msgs::FollowJointTrajectoryGoal& goal);

/// A joint of a trajectory, with the scale of its axis.
struct TrajectoryJoint {
  std::string name;
  config::Kind kind = config::Kind::kLinear;
  double steps_per_unit = 1.0;
};

/// The positions of joints by the plan, and by their pulses.
struct JointPlaces {
  std::vector<double> planned;
  std::vector<double> actual;
};

/// The mean velocities of the plan and of the pulses over the last tenth of a second, or a little
/// more. A shorter time would only show how the pulses are spread.
class MeanVelocities {
 public:
  /// @param now [s] on any clock.
  /// @return empty until a tenth of a second has passed since the first call.
  std::optional<JointPlaces> add(double now, const JointPlaces& places);

 private:
  std::deque<std::pair<double, JointPlaces>> past_;  // the first one is old enough, or the oldest
};

/// @param tolerance its name, for the sentence. @param limits, wanted, actual of each joint.
/// @return a sentence about the first joint that is too far off; empty: there is none.
std::string violation(const char* tolerance, const std::vector<TrajectoryJoint>& joints,
                      const std::vector<double>& limits, const std::vector<double>& wanted,
                      const std::vector<double>& actual);

/// The same for velocities.
std::string velocityViolation(const char* tolerance, const std::vector<TrajectoryJoint>& joints,
                              const std::vector<double>& limits, const std::vector<double>& wanted,
                              const std::vector<double>& actual);

}  // namespace stepdriver::ros_node
