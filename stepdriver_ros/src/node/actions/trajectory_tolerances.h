#pragma once

#include <string>
#include <vector>

#include "follow_joint_trajectory.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::ros_node {

/// How far the joints may deviate from a trajectory. The numbers are in the units of the joints and
/// in the order of the goal; infinite if there is no limit.
struct TrajectoryTolerances {
  std::vector<double> path;
  std::vector<double> goal;
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

/// @param tolerance its name, for the sentence. @param limits, wanted, actual of each joint.
/// @return a sentence about the first joint that is too far off; empty: there is none.
std::string violation(const char* tolerance, const std::vector<TrajectoryJoint>& joints,
                      const std::vector<double>& limits, const std::vector<double>& wanted,
                      const std::vector<double>& actual);

}  // namespace stepdriver::ros_node
