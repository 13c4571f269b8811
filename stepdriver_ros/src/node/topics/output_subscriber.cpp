#include "output_subscriber.h"

#include <ros/console.h>
#include <ros/transport_hints.h>
#include <std_msgs/Float64.h>

#include <cstdint>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::uint32_t kQueuedValues = 1;

}  // namespace

OutputSubscriber::OutputSubscriber(ros::NodeHandle node, machine::Machine& machine,
                                   CallQueues& queues, LatchedMessages& latched) {
  node.setCallbackQueue(&queues.outputs());
  for (const machine::OutputState& output : machine.ioStates().outputs) {
    const std::string name = output.name;
    subscribers_.push_back(subscribeToNew<std_msgs::Float64>(
        node, "outputs/" + name, kQueuedValues, latched,
        [&machine, name](const std_msgs::Float64::ConstPtr& message) {
          try {
            switchTo(machine, name, message->data);
          } catch (const Error& error) {
            ROS_WARN_THROTTLE_NAMED(1.0, "outputs", "%s", error.what());
          }
        },
        ros::TransportHints().tcpNoDelay()));
  }
}

}  // namespace stepdriver::ros_node
