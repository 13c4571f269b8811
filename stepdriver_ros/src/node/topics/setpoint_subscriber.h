#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>

#include <cstddef>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "common/latched_messages.h"
#include "common/log_throttle.h"
#include "message_stream.h"
#include "node/calls/bounded.h"
#include "node/calls/call_queues.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The topics ~AXIS/setpoint and ~setpoint: streams of positions or velocities, see
/// machine::Machine::followSetpoints(). A number that isn't finite is ignored. A stream does not
/// continue after a stop of its axis, whichever topic it came by.
class SetpointSubscriber {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, latched outlive the subscriber.
  /// @param timeout [s] without a message until an axis comes to rest.
  SetpointSubscriber(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                     LatchedMessages& latched, machine::SetpointMode mode, double timeout);
  SetpointSubscriber(const SetpointSubscriber&) = delete;
  SetpointSubscriber& operator=(const SetpointSubscriber&) = delete;

 private:
  struct Own {
    MessageStream stream;
    bool said_not_finite = false;  // since the last finite number
  };

  void takeAll(const boost::shared_ptr<const Bounded<std_msgs::Float64MultiArray>>& message);
  /// @param first the axis of the first value.
  void follow(std::size_t first, const std::vector<double>& values);
  /// Adds the message for an axis, unless its number isn't finite.
  void add(std::size_t axis, double value, std::vector<machine::StreamMessage>& messages);
  void warn(const std::string& why);

  machine::Machine& machine_;
  const machine::SetpointMode mode_;
  const double timeout_;
  LogThrottle warnings_;
  std::mutex mutex_;
  std::vector<Own> axes_;
  std::deque<ros::Subscriber> subscribers_;
};

}  // namespace stepdriver::ros_node
