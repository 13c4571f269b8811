#include "jog_subscriber.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <ros/transport_hints.h>

#include <algorithm>
#include <cmath>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

// A stream of messages: an old one is useless when the next has arrived.
constexpr std::uint32_t kQueuedJogs = 1;
// The accuracy of the timeout, as a part of it.
constexpr double kTimeoutPart = 0.05;

}  // namespace

JogSubscriber::JogSubscriber(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                             LatchedMessages& latched, double timeout)
    : machine_(machine),
      timeout_(timeout),
      streams_(machine.axes().size()),
      heard_(machine.axes().size()),
      poll_(onQueue(queues.control(), node), ros::WallDuration(timeout * kTimeoutPart),
            [this] { return endWhatIsOver(); }) {
  node.setCallbackQueue(&queues.control());
  subscriber_ = subscribeToNew<Bounded<Jog>>(
      node, "jog", kQueuedJogs, latched, [this](const auto& message) { onMessage(message); },
      ros::TransportHints().tcpNoDelay());
}

void JogSubscriber::onMessage(const boost::shared_ptr<const Bounded<Jog>>& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const std::vector<std::size_t> axes = axesOf(*message);
    for (std::size_t i = 0; i < axes.size(); ++i) {
      if (message->velocity[i] == 0.0) streams_[axes[i]].end();
    }
    jog(axes, message->velocity);
  } catch (const Refused& refused) {
    ROS_WARN_THROTTLE_NAMED(1.0, "jog", "jog: %s", refused.what());
  }
}

std::vector<std::size_t> JogSubscriber::axesOf(const Jog& message) const {
  if (message.name.size() != message.velocity.size()) {
    throw Refused(
        fmt::format("there are {} names and {} velocities; each name must have one velocity",
                    message.name.size(), message.velocity.size()));
  }
  std::vector<std::size_t> axes;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    const axis::Axis& wanted = machine_.axis(message.name[i]);
    const auto found = std::find_if(machine_.axes().begin(), machine_.axes().end(),
                                    [&wanted](const auto& axis) { return axis.get() == &wanted; });
    const auto index = static_cast<std::size_t>(found - machine_.axes().begin());
    if (std::find(axes.begin(), axes.end(), index) != axes.end()) {
      throw Refused("the axis " + message.name[i] + " is named twice");
    }
    if (!std::isfinite(message.velocity[i])) {
      throw Refused(fmt::format("{}: the velocity is {}, but must be a finite number",
                                message.name[i], message.velocity[i]));
    }
    axes.push_back(index);
  }
  return axes;
}

void JogSubscriber::jog(const std::vector<std::size_t>& axes,
                        const std::vector<double>& velocities) {
  std::vector<machine::StreamMessage> messages;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const axis::Axis& wanted = *machine_.axes()[axes[i]];
    machine::StreamMessage& message = messages.emplace_back();
    message.name = wanted.config().name;
    message.value = velocities[i];
    if (velocities[i] != 0.0) {
      message.unless_stopped_since = streams_[axes[i]].stopsAtBegin(wanted, timeout_);
    } else {
      heard_[axes[i]] = ros::SteadyTime();
    }
  }
  std::vector<std::string> refusals;
  try {
    refusals = machine_.jog(messages);
  } catch (const Error& error) {
    refusals.assign(axes.size(), error.what());
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (!refusals[i].empty()) {
      ROS_WARN_THROTTLE_NAMED(1.0, "jog", "jog: %s", refusals[i].c_str());
    } else if (velocities[i] != 0.0) {
      heard_[axes[i]] = ros::SteadyTime::now();
      poll_.begin();
    }
    if (velocities[i] != 0.0) streams_[axes[i]].noteHandled();
  }
}

bool JogSubscriber::endWhatIsOver() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::SteadyTime now = ros::SteadyTime::now();
  std::vector<std::size_t> silent;
  for (std::size_t axis = 0; axis < heard_.size(); ++axis) {
    if (heard_[axis].isZero() || now - heard_[axis] < timeout_) continue;
    silent.push_back(axis);
    ROS_INFO_NAMED("jog", "%s: no jog for %g s, so it comes to rest",
                   machine_.axes()[axis]->config().name.c_str(), timeout_.toSec());
  }
  // Refused messages may still come: their streams don't end with this.
  if (!silent.empty()) jog(silent, std::vector<double>(silent.size()));
  return std::any_of(heard_.begin(), heard_.end(),
                     [](const ros::SteadyTime& heard) { return !heard.isZero(); });
}

}  // namespace stepdriver::ros_node
