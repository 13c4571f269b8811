#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/steady_timer.h>
#include <ros/time.h>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::ros_node {

/// Publishes the time of the simulated rig on /clock, 100 times a second, for nodes with
/// use_sim_time. It begins at the time of day, so that it doesn't go back if the node is started
/// again, unless the rig was faster than real time.
class ClockPublisher {
 public:
  /// @param node its queue serves the timer.
  /// @param clock of the rig; outlives the publisher.
  ClockPublisher(ros::NodeHandle node, pulse::Clock& clock);

 private:
  void publish();

  pulse::Clock& clock_;
  const ros::WallTime began_;
  const pulse::Nanoseconds began_at_;  // what the clock showed then
  ros::Publisher publisher_;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
