#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <memory>
#include <vector>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// Publishes the topic driver of an axis: what its chips have said, whenever they have been asked.
/// An axis without a chip on a UART has no such topic. For one thread.
class DriverPublisher {
 public:
  /// @param node of the axis's names. @param state of the axis, which says whether there are chips.
  DriverPublisher(ros::NodeHandle node, const axis::AxisState& state);

  /// Publishes the state unless it is the one that was published last.
  void publish(const axis::AxisState& state, ros::Time stamp);

 private:
  ros::Publisher publisher_;
  std::shared_ptr<const std::vector<driver::DriverState>> published_;
};

}  // namespace stepdriver::ros_node
