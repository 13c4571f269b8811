#pragma once

#include <ros/time.h>

#include <cstdint>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// Consecutive messages for one axis, each within a timeout of the one before it. Such a stream
/// does not continue after anything that stopped the axis: it has to pause for the timeout first.
class MessageStream {
 public:
  /// A message has come. @return AxisState::stops as it was when its stream began.
  std::uint64_t stopsAtBegin(const axis::Axis& axis, const ros::WallDuration& timeout) {
    const bool goes_on = !last_.isZero() && ros::SteadyTime::now() - last_ < timeout;
    if (!goes_on) stops_ = axis.state().stops;
    return stops_;
  }

  /// A message was handled, or refused. A call that had to wait is no pause of the stream.
  void noteHandled() { last_ = ros::SteadyTime::now(); }

  /// The next message begins a stream.
  void end() { last_ = ros::SteadyTime(); }

 private:
  ros::SteadyTime last_;     // when its last message was handled; zero: there is no stream
  std::uint64_t stops_ = 0;  // when it began
};

}  // namespace stepdriver::ros_node
