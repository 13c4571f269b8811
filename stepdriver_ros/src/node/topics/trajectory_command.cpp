#include "trajectory_command.h"

#include <ros/console.h>
#include <ros/transport_hints.h>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

// A newer trajectory replaces an older one: only those of several clients can queue up.
constexpr std::uint32_t kQueuedTrajectories = 10;

}  // namespace

TrajectoryCommand::TrajectoryCommand(ros::NodeHandle node, machine::Machine& machine,
                                     CallQueues& queues, LatchedMessages& latched,
                                     bool allow_slower)
    : machine_(machine), axes_(axisOfJoint(machine)), allow_slower_(allow_slower) {
  node.setCallbackQueue(&queues.trajectories());
  subscriber_ = subscribeToNew<Message>(
      node, "command", kQueuedTrajectories, latched,
      [this](const auto& message) { onMessage(message); }, ros::TransportHints().tcpNoDelay());
}

void TrajectoryCommand::onMessage(const boost::shared_ptr<const Message>& message) {
  try {
    if (message->points.empty()) {
      stop(message->joint_names);
    } else {
      followMessage(machine_, *message, axes_, allow_slower_);
    }
  } catch (const Error& error) {
    const std::string why = error.what();
    if (log_.isDue(why)) ROS_WARN_NAMED("trajectory", "command: %s", why.c_str());
  }
}

void TrajectoryCommand::stop(const std::vector<std::string>& joints) {
  if (joints.empty()) return machine_.stop();
  for (const std::string& axis : axesOf(joints, axes_)) machine_.axis(axis).stop();
}

}  // namespace stepdriver::ros_node
