#pragma once

#include <ros/time.h>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::ros_node {

/// The time of ROS at times of the machine's clock.
class MachineTime {
 public:
  /// The present on both clocks.
  struct Now {
    ros::Time ros;
    pulse::Nanoseconds machine = 0;
  };

  /// @param clock outlives it.
  /// @param speed of the clock: its seconds per second; 0: it doesn't follow the time.
  MachineTime(pulse::Clock& clock, double speed) : clock_(clock), speed_(speed) {}

  Now now() const { return {ros::Time::now(), clock_.now()}; }

  /// Without a clock of ROS that follows the rig's, what happened has the time at which it was
  /// seen.
  ros::Time at(pulse::Nanoseconds time, const Now& seen) const {
    double ago = static_cast<double>(seen.machine - time) * 1e-9;
    if (!ros::Time::isSimTime()) ago = speed_ > 0.0 ? ago / speed_ : 0.0;
    return seen.ros.toSec() > ago ? seen.ros - ros::Duration(ago) : ros::Time(0, 1);
  }

 private:
  pulse::Clock& clock_;
  const double speed_;
};

}  // namespace stepdriver::ros_node
