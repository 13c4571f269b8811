#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <string>
#include <vector>

#include "common/latched_messages.h"
#include "node/calls/call_queues.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// Switches an output. @param value 0: off. @throw Refused, GpioError as Machine::setOutput()
inline void switchTo(machine::Machine& machine, const std::string& output, double value) {
  const bool on = value != 0.0;
  machine.setOutput(output, on, on ? value : 1.0);
}

/// The topics ~outputs/NAME: each message switches the output, or gives a PWM output another value.
/// What is refused is logged, at most once a second. While one is carried out, only the newest of
/// those that come is kept.
class OutputSubscriber {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, latched outlive the subscriber.
  OutputSubscriber(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                   LatchedMessages& latched);
  OutputSubscriber(const OutputSubscriber&) = delete;
  OutputSubscriber& operator=(const OutputSubscriber&) = delete;

 private:
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace stepdriver::ros_node
