#pragma once

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
#include <control_msgs/FollowJointTrajectoryAction.h>
#else
#include <stepdriver/FollowJointTrajectoryAction.h>
#endif

namespace stepdriver::ros_node {

/// The action of trajectories: that of control_msgs if it was found, otherwise this package's with
/// the same fields. Connections are matched by md5sums, which are the same.
#ifdef STEPDRIVER_HAS_CONTROL_MSGS
namespace action_msgs = control_msgs;
#else
namespace action_msgs = stepdriver;
#endif

}  // namespace stepdriver::ros_node
