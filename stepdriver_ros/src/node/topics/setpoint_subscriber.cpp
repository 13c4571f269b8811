#include "setpoint_subscriber.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <ros/transport_hints.h>

#include <chrono>
#include <cmath>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

// A stream of messages: an old one is useless when the next has arrived.
constexpr std::uint32_t kQueuedSetpoints = 1;
constexpr std::chrono::seconds kWarnPeriod{1};

}  // namespace

SetpointSubscriber::SetpointSubscriber(ros::NodeHandle node, machine::Machine& machine,
                                       CallQueues& queues, LatchedMessages& latched,
                                       machine::SetpointMode mode, double timeout)
    : machine_(machine),
      mode_(mode),
      timeout_(timeout),
      warnings_(kWarnPeriod),
      axes_(machine.axes().size()) {
  node.setCallbackQueue(&queues.streams());
  const auto no_delay = ros::TransportHints().tcpNoDelay();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    subscribers_.push_back(subscribeToNew<std_msgs::Float64>(
        node, machine.axes()[i]->config().name + "/setpoint", kQueuedSetpoints, latched,
        [this, i](const auto& message) { follow(i, {message->data}); }, no_delay));
  }
  subscribers_.push_back(subscribeToNew<Bounded<std_msgs::Float64MultiArray>>(
      node, "setpoint", kQueuedSetpoints, latched,
      [this](const auto& message) { takeAll(message); }, no_delay));
}

void SetpointSubscriber::takeAll(
    const boost::shared_ptr<const Bounded<std_msgs::Float64MultiArray>>& message) {
  if (message->data.size() != axes_.size() || message->layout.data_offset != 0) {
    return warn(fmt::format(
        "the message has {} numbers and a data_offset of {}; it must have a number for each of the "
        "{} axes, in their order, and no offset",
        message->data.size(), message->layout.data_offset, axes_.size()));
  }
  follow(0, message->data);
}

void SetpointSubscriber::add(std::size_t axis, double value,
                             std::vector<machine::StreamMessage>& messages) {
  Own& own = axes_[axis];
  const axis::Axis& wanted = *machine_.axes()[axis];
  if (!std::isfinite(value)) {
    if (!own.said_not_finite) {
      ROS_WARN_NAMED("setpoint",
                     "setpoint: %s: setpoints that aren't finite numbers are ignored: %g",
                     wanted.config().name.c_str(), value);
    }
    own.said_not_finite = true;
    return;
  }
  own.said_not_finite = false;
  // As for a jog, the message after a velocity of 0 begins another stream.
  if (mode_ == machine::SetpointMode::kVelocity && value == 0.0) own.stream.end();
  messages.push_back(
      {wanted.config().name, value, own.stream.stopsAtBegin(wanted, ros::WallDuration(timeout_))});
}

void SetpointSubscriber::warn(const std::string& why) {
  if (warnings_.isDue()) ROS_WARN_NAMED("setpoint", "setpoint: %s", why.c_str());
}

void SetpointSubscriber::follow(std::size_t first, const std::vector<double>& values) {
  std::vector<machine::StreamMessage> messages;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t i = 0; i < values.size(); ++i) add(first + i, values[i], messages);
  }
  if (messages.empty()) return;
  // Without the mutex: an axis that must be woken first delays no other.
  try {
    for (const std::string& why : machine_.followSetpoints(mode_, timeout_, messages)) {
      if (!why.empty()) warn(why);
    }
  } catch (const Error& error) {
    warn(error.what());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) axes_[first + i].stream.noteHandled();
  }
}

}  // namespace stepdriver::ros_node
