#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/JointState.h>
#include <stepdriver/AxisState.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Endstops.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#include "driver_publisher.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// Publishes joint_states, ~endstops, ~axis_states, each axis's state and driver, and ~state from a
/// thread of its own, so that waiting calls don't slow it down. One thread calls start() and
/// stop().
class StatePublisher {
 public:
  /// @param node, private_node handles of the node, and of its private names.
  /// @param machine outlives the publisher.
  /// @param joint_state_rate [Hz]
  StatePublisher(ros::NodeHandle node, ros::NodeHandle private_node,
                 const machine::Machine& machine, double joint_state_rate);
  ~StatePublisher();
  StatePublisher(const StatePublisher&) = delete;
  StatePublisher& operator=(const StatePublisher&) = delete;

  void start();

  /// Publishes everything once more, and ends the thread.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  void run();
  bool sleepUntil(Clock::time_point time);
  void readStates();
  void logEndstop(std::size_t axis) const;
  void publishJointStates();
  void publishControllerState();
  void publishEndstopsOnChange();
  void publishAxisStates(bool only_on_change);
  void publishStateOfEachAxis(bool due);
  void publishDrivers();

  const machine::Machine& machine_;
  const Clock::duration joint_state_period_;
  ros::Publisher joint_state_publisher_;
  ros::Publisher controller_state_publisher_;
  ros::Publisher endstop_publisher_;
  ros::Publisher axis_state_publisher_;
  std::vector<ros::Publisher> own_state_publishers_;  // one for each axis
  std::vector<DriverPublisher> driver_publishers_;    // the same

  // For the thread only.
  sensor_msgs::JointState joint_states_;
  Endstops endstops_;
  std::vector<axis::AxisState> states_;
  ros::Time states_read_;
  std::vector<axis::AxisState> published_states_;
  bool endstops_published_ = false;
  std::vector<bool> endstops_unreadable_;  // one for each axis

  std::mutex mutex_;
  std::condition_variable stop_asked_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::ros_node
