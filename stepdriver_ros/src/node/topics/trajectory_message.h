#pragma once

#include <ros/time.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// A trajectory's message that can't be followed, for what is in it.
class BadTrajectory : public Refused {
 public:
  enum class Kind {
    kInvalid,
    kJoints,    ///< a joint that isn't there, none, or one twice
    kOldStamp,  ///< a point of it is in the past
  };

  BadTrajectory(Kind kind, const std::string& message) : Refused(message), kind_(kind) {}

  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

/// Names of axes by those of their joints.
using AxisOfJoint = std::map<std::string, std::string>;

AxisOfJoint axisOfJoint(const machine::Machine& machine);

/// @return the axes of these joints, in their order.
/// @throw BadTrajectory where a joint isn't there or is named twice, or none is named.
std::vector<std::string> axesOf(const std::vector<std::string>& joints, const AxisOfJoint& axes);

/// What a trajectory's message asks of the axes.
struct TimedTrajectory {
  machine::TrajectoryRequest request;
  double delay = 0.0;  ///< [s] until it starts; the request's times count from then on
};

/// Reads a message. Its header's stamp says when the trajectory starts: 0 at once. Where that has
/// gone by, the points come so much sooner; a first one at time 0 only says where it begins, and is
/// never too late where others follow. Numbers and their count are left for the machine to judge.
///
/// @throw BadTrajectory
TimedTrajectory timedTrajectory(const trajectory_msgs::JointTrajectory& message,
                                const AxisOfJoint& axes, ros::Time now);

/// Adds the rest until a trajectory starts; a first point at time 0 goes on to say where it begins.
///
/// @param positions [unit] where its axes stand.
machine::TrajectoryRequest withDelay(const TimedTrajectory& trajectory,
                                     const std::vector<double>& positions);

/// Has the machine follow a message. One that starts later keeps its axes at rest until then: stops
/// and later commands end that as they end a motion.
///
/// @throw BadTrajectory; Refused as Machine::followTrajectory(), and where the trajectory starts
///   later and an axis of it moves.
machine::CoordinatedMove followMessage(machine::Machine& machine,
                                       const trajectory_msgs::JointTrajectory& message,
                                       const AxisOfJoint& axes);

}  // namespace stepdriver::ros_node
