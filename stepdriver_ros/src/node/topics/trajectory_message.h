#pragma once

#include <ros/time.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// A trajectory's message whose contents can't be followed.
class BadTrajectory : public Refused {
 public:
  enum class Kind {
    kInvalid,
    kJoints,    ///< an unknown joint, no joint, or a joint twice
    kOldStamp,  ///< all points are in the past
  };

  BadTrajectory(Kind kind, const std::string& message) : Refused(message), kind_(kind) {}

  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

/// Names of axes by the names of their joints.
using AxisOfJoint = std::map<std::string, std::string>;

AxisOfJoint axisOfJoint(const machine::Machine& machine);

/// @return the axes of these joints, in their order.
/// @throw BadTrajectory if a joint is unknown or named twice, or none is named.
std::vector<std::string> axesOf(const std::vector<std::string>& joints, const AxisOfJoint& axes);

/// Translates a message for the axes. The header's stamp gives the start of the trajectory; 0 means
/// at once. A stamp in the past shortens the time to the points, and those that are in the past are
/// dropped. A first point at time 0 only gives the start position, and is kept if all others are
/// ahead. The machine checks the numbers and
/// their count.
///
/// @throw BadTrajectory
motion::TrajectoryRequest trajectoryRequest(const trajectory_msgs::JointTrajectory& message,
                                            const AxisOfJoint& axes, ros::Time now);

/// Makes the machine follow a message.
///
/// @param allow_slower see motion::TrajectoryRequest.
/// @throw BadTrajectory; Refused as Machine::followTrajectory().
machine::CoordinatedMove followMessage(machine::Machine& machine,
                                       const trajectory_msgs::JointTrajectory& message,
                                       const AxisOfJoint& axes, bool allow_slower);

}  // namespace stepdriver::ros_node
