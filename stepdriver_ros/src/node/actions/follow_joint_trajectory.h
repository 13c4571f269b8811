#pragma once

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
#include <control_msgs/FollowJointTrajectoryAction.h>
#include <control_msgs/JointTrajectoryControllerState.h>
#else
#include <stepdriver/FollowJointTrajectoryAction.h>
#include <stepdriver/JointTrajectoryControllerState.h>
#endif

namespace stepdriver::ros_node {

/// The messages of trajectories: those of control_msgs if it was found, otherwise this package's
/// with the same fields. Connections are matched by md5sums, which are the same.
#ifdef STEPDRIVER_HAS_CONTROL_MSGS
namespace action_msgs = control_msgs;
#else
namespace action_msgs = stepdriver;
#endif

}  // namespace stepdriver::ros_node
