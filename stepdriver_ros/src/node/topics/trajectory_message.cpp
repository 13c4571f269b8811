#include "trajectory_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "common/text.h"

namespace stepdriver::ros_node {
namespace {

using Wrong = BadTrajectory::Kind;

// [s] A shorter delay starts at once: plans begin this far in the future anyway.
constexpr double kShortestDelay = 0.001;

std::string namesOf(const AxisOfJoint& axes) {
  std::string names;
  for (const auto& [joint, axis] : axes) names += (names.empty() ? "" : ", ") + joint;
  return names;
}

/// [s] A difference of two times can be more than a ros::Duration, which then throws, can hold.
double secondsFrom(ros::Time begin, ros::Time end) {
  return 1e-9 * static_cast<double>(static_cast<std::int64_t>(end.toNSec()) -
                                    static_cast<std::int64_t>(begin.toNSec()));
}

/// [s] A point's time after the start of a trajectory that began `late` ago.
double timeOf(const trajectory_msgs::JointTrajectory& message, std::size_t index, double late) {
  const double planned = message.points[index].time_from_start.toSec();
  if (late == 0.0) return planned;
  const bool tells_where_it_begins = index == 0 && planned == 0.0 && message.points.size() > 1;
  if (tells_where_it_begins) return 0.0;
  if (planned <= late) {
    throw BadTrajectory(Wrong::kOldStamp,
                        fmt::format("point {}, {} s after header.stamp, is in the past by {} s",
                                    index, roundedText(planned), roundedText(late - planned)));
  }
  return planned - late;
}

axis::TrajectoryPoint pointOf(const trajectory_msgs::JointTrajectoryPoint& point, double time) {
  axis::TrajectoryPoint converted;
  converted.time = time;
  converted.positions = point.positions;
  converted.velocities = point.velocities;
  converted.accelerations = point.accelerations;
  return converted;
}

}  // namespace

AxisOfJoint axisOfJoint(const machine::Machine& machine) {
  AxisOfJoint axes;
  for (const auto& axis : machine.axes()) axes[axis->config().joint] = axis->config().name;
  return axes;
}

std::vector<std::string> axesOf(const std::vector<std::string>& joints, const AxisOfJoint& axes) {
  if (joints.empty()) {
    throw BadTrajectory(Wrong::kJoints, "it names no joint; there are " + namesOf(axes));
  }
  std::vector<std::string> found;
  for (const std::string& joint : joints) {
    const auto axis = axes.find(joint);
    if (axis == axes.end()) {
      throw BadTrajectory(Wrong::kJoints,
                          fmt::format("there is no joint {}; there are {}", joint, namesOf(axes)));
    }
    if (std::find(found.begin(), found.end(), axis->second) != found.end()) {
      throw BadTrajectory(Wrong::kJoints, "the joint " + joint + " is named twice");
    }
    found.push_back(axis->second);
  }
  return found;
}

machine::TrajectoryRequest trajectoryRequest(const trajectory_msgs::JointTrajectory& message,
                                             const AxisOfJoint& axes, ros::Time now) {
  machine::TrajectoryRequest request;
  request.names = axesOf(message.joint_names, axes);
  if (message.points.empty()) throw BadTrajectory(Wrong::kInvalid, "it has no points");
  const double ahead = message.header.stamp.isZero() ? 0.0 : secondsFrom(now, message.header.stamp);
  if (ahead > kShortestDelay) request.begin_in = ahead;
  const double late = std::max(0.0, -ahead);
  for (std::size_t i = 0; i < message.points.size(); ++i) {
    request.points.push_back(pointOf(message.points[i], timeOf(message, i, late)));
  }
  return request;
}

machine::CoordinatedMove followMessage(machine::Machine& machine,
                                       const trajectory_msgs::JointTrajectory& message,
                                       const AxisOfJoint& axes, bool allow_slower) {
  machine::TrajectoryRequest request = trajectoryRequest(message, axes, ros::Time::now());
  request.allow_slower = allow_slower;
  return machine.followTrajectory(request);
}

}  // namespace stepdriver::ros_node
