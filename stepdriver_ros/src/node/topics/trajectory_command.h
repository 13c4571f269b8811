#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <trajectory_msgs/JointTrajectory.h>

#include "common/latched_messages.h"
#include "node/calls/bounded.h"
#include "node/calls/call_queues.h"
#include "node/refusal_log.h"
#include "stepdriver_core/machine/machine.h"
#include "trajectory_message.h"

namespace stepdriver::ros_node {

/// The topic ~command: a trajectory replaces the motions of its joints. Without points it stops
/// them, or all axes if it names no joint. A refused message moves nothing and is logged.
class TrajectoryCommand {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, latched outlive the subscriber.
  /// @param allow_slower see motion::TrajectoryRequest.
  TrajectoryCommand(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                    LatchedMessages& latched, bool allow_slower);
  TrajectoryCommand(const TrajectoryCommand&) = delete;
  TrajectoryCommand& operator=(const TrajectoryCommand&) = delete;

 private:
  using Message = Bounded<trajectory_msgs::JointTrajectory>;

  void onMessage(const boost::shared_ptr<const Message>& message);
  void stop(const std::vector<std::string>& joints);

  machine::Machine& machine_;
  const AxisOfJoint axes_;
  const bool allow_slower_;
  RefusalLog log_;
  ros::Subscriber subscriber_;
};

}  // namespace stepdriver::ros_node
