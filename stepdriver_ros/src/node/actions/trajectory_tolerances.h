#pragma once

#include <string>
#include <vector>

#include "follow_joint_trajectory.h"

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

/// @param limits, wanted, actual of each joint.
/// @return a sentence about the first joint that is too far off; empty: there is none.
std::string violation(const std::vector<std::string>& joints, const std::vector<double>& limits,
                      const std::vector<double>& wanted, const std::vector<double>& actual);

}  // namespace stepdriver::ros_node
