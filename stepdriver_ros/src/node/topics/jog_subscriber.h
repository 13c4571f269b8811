#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <stepdriver/Jog.h>

#include <cstddef>
#include <mutex>
#include <string>
#include <vector>

#include "common/latched_messages.h"
#include "message_stream.h"
#include "node/calls/bounded.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The topic ~jog. A message that can't be understood moves nothing; if one axis refuses its
/// velocity, the others still move, all from the same time on. Both are logged, at most once a
/// second. A stream of messages does not continue after a stop of the axis: messages are refused
/// until the stream has paused for the timeout or sent 0.
class JogSubscriber {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, latched outlive the subscriber.
  /// @param timeout [s] on the steady clock, after which an axis without a message comes to rest.
  JogSubscriber(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                LatchedMessages& latched, double timeout);
  JogSubscriber(const JogSubscriber&) = delete;
  JogSubscriber& operator=(const JogSubscriber&) = delete;

 private:
  void onMessage(const boost::shared_ptr<const Bounded<Jog>>& message);
  /// @return the indices of the axes that the message names. @throw Refused
  std::vector<std::size_t> axesOf(const Jog& message) const;
  void jog(const std::vector<std::size_t>& axes, const std::vector<double>& velocities);
  /// @return whether there are axes that still jog.
  bool endWhatIsOver();

  machine::Machine& machine_;
  const ros::WallDuration timeout_;
  std::mutex mutex_;
  std::vector<MessageStream> streams_;  // one for each axis
  // Time of each axis's last accepted message; zero: there is no jog.
  std::vector<ros::SteadyTime> heard_;
  PeriodicPoll poll_;
  ros::Subscriber subscriber_;
};

}  // namespace stepdriver::ros_node
