#include "trajectory_message.h"

#include <fmt/format.h>
#include <ros/console.h>

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

/// The first point of a trajectory, which began `late` ago, that isn't in the past.
std::size_t firstPoint(const trajectory_msgs::JointTrajectory& message, double late) {
  const auto time = [&message](std::size_t index) {
    return message.points[index].time_from_start.toSec();
  };
  if (late == 0.0) return 0;
  std::size_t first = 0;
  while (first < message.points.size() && time(first) <= late) ++first;
  if (first == message.points.size()) {
    throw BadTrajectory(
        Wrong::kOldStamp,
        fmt::format(
            "all of its points are in the past: the last one, {} s after header.stamp, by {} s",
            roundedText(time(first - 1)), roundedText(late - time(first - 1))));
  }
  // The point at time 0 only gives the position of the start.
  return first == 1 && time(0) == 0.0 ? 0 : first;
}

motion::TrajectoryPoint pointOf(const trajectory_msgs::JointTrajectoryPoint& point, double time) {
  motion::TrajectoryPoint converted;
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
    throw BadTrajectory(Wrong::kJoints, "it names no joint (joints: " + namesOf(axes) + ")");
  }
  std::vector<std::string> found;
  for (const std::string& joint : joints) {
    const auto axis = axes.find(joint);
    if (axis == axes.end()) {
      throw BadTrajectory(Wrong::kJoints,
                          fmt::format("there is no joint {} (joints: {})", joint, namesOf(axes)));
    }
    if (std::find(found.begin(), found.end(), axis->second) != found.end()) {
      throw BadTrajectory(Wrong::kJoints, "the joint " + joint + " is named twice");
    }
    found.push_back(axis->second);
  }
  return found;
}

motion::TrajectoryRequest trajectoryRequest(const trajectory_msgs::JointTrajectory& message,
                                            const AxisOfJoint& axes, ros::Time now) {
  motion::TrajectoryRequest request;
  request.names = axesOf(message.joint_names, axes);
  if (message.points.empty()) throw BadTrajectory(Wrong::kInvalid, "it has no points");
  const double ahead = message.header.stamp.isZero() ? 0.0 : secondsFrom(now, message.header.stamp);
  if (ahead > kShortestDelay) request.begin_in = ahead;
  const double late = std::max(0.0, -ahead);
  for (std::size_t i = firstPoint(message, late); i < message.points.size(); ++i) {
    const double time = message.points[i].time_from_start.toSec();
    request.points.push_back(
        pointOf(message.points[i], late > 0.0 ? std::max(0.0, time - late) : time));
  }
  return request;
}

machine::CoordinatedMove followMessage(machine::Machine& machine,
                                       const trajectory_msgs::JointTrajectory& message,
                                       const AxisOfJoint& axes, bool allow_slower) {
  motion::TrajectoryRequest request = trajectoryRequest(message, axes, ros::Time::now());
  request.allow_slower = allow_slower;
  if (const std::size_t dropped = message.points.size() - request.points.size(); dropped > 0) {
    ROS_WARN_NAMED("trajectory", "The first %zu of %zu points are dropped: they are in the past",
                   dropped, message.points.size());
  }
  return machine.followTrajectory(request);
}

}  // namespace stepdriver::ros_node
