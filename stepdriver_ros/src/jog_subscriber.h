#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <stepdriver/Jog.h>

#include <cstddef>
#include <mutex>
#include <string>
#include <vector>

#include "call_queues.h"
#include "looking.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The topic ~jog. A message that can't be understood moves nothing; an axis that refuses its
/// velocity doesn't keep the others from theirs. Both are logged, at most once a second.
class JogSubscriber {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues outlive the subscriber.
  /// @param timeout [s] on the steady clock, after which an axis without a message comes to rest.
  JogSubscriber(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                double timeout);
  JogSubscriber(const JogSubscriber&) = delete;
  JogSubscriber& operator=(const JogSubscriber&) = delete;

 private:
  void take(const Jog::ConstPtr& message);
  /// @return the axes that the message names, by their index. @throw Refused
  std::vector<std::size_t> axesOf(const Jog& message) const;
  void jog(std::size_t axis, double velocity);
  /// @return whether there are axes that still jog.
  bool endWhatIsOver();

  machine::Machine& machine_;
  const ros::WallDuration timeout_;
  std::mutex mutex_;
  std::vector<ros::SteadyTime> heard_;  // the last message of each axis; zero: none, or it is over
  Looking looking_;
  ros::Subscriber subscriber_;
};

}  // namespace stepdriver::ros_node
