#pragma once

#include <string>
#include <vector>

#include "follow_joint_trajectory.h"

namespace stepdriver::ros_node {

/// How far the joints of a trajectory may be from where it wants them. Numbers are of the joints in
/// the order of the goal, in their units; infinite where there is no limit.
struct TrajectoryTolerances {
  std::vector<double> path;
  std::vector<double> goal;
  double goal_time = 0.0;  ///< [s]
};

/// @throw BadTrajectory for a joint that isn't the trajectory's, and for what isn't a number.
TrajectoryTolerances readTolerances(const action_msgs::FollowJointTrajectoryGoal& goal);

/// @param limits, wanted, actual of each joint.
/// @return the first joint that is too far off, in a sentence; empty: none.
std::string violation(const std::vector<std::string>& joints, const std::vector<double>& limits,
                      const std::vector<double>& wanted, const std::vector<double>& actual);

}  // namespace stepdriver::ros_node
