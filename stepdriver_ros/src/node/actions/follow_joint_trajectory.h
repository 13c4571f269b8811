#pragma once

#ifdef STEPDRIVER_HAS_CONTROL_MSGS
#include <control_msgs/FollowJointTrajectoryAction.h>
#else
#include <stepdriver/FollowJointTrajectoryAction.h>
#endif

namespace stepdriver::ros_node {

/// The action of trajectories: control_msgs' where that was found, else this package's with the
/// same fields. A connection is made by the md5sums, and these are the same.
#ifdef STEPDRIVER_HAS_CONTROL_MSGS
namespace action_msgs = control_msgs;
#else
namespace action_msgs = stepdriver;
#endif

}  // namespace stepdriver::ros_node
