#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/Twist.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/steady_timer.h>
#include <ros/subscriber.h>
#include <sensor_msgs/JointState.h>
#include <stepdriver/AxisStates.h>
#include <tf2_ros/transform_broadcaster.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base_config.h"
#include "common/background_call.h"
#include "common/latched_messages.h"
#include "common/master_directory.h"
#include "drive.h"
#include "driver_wheels.h"
#include "odometry.h"

namespace stepdriver::base {

/// Turns the topic `cmd_vel` into the driver's `jog`, in one message for all wheels, and into calls
/// of the steering's `move_to`, and the driver's `joint_states` into `odom` and the transform.
///
/// Its callbacks run in one thread, which also creates it and calls rest().
class Base {
 public:
  /// @param driver full name of the node that drives the axes.
  Base(ros::NodeHandle node, const std::string& driver, BaseConfig config, DriverWheels wheels);
  Base(const Base&) = delete;
  Base& operator=(const Base&) = delete;

  /// Stops all wheels that this node drives.
  void rest();

  /// See LatchedMessages. Any thread.
  bool lookAgain() { return latched_.lookAgain(); }

 private:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;

  void takeCommand(const geometry_msgs::Twist& message);
  void takeStates(const AxisStates& message);
  void takeJoints(const sensor_msgs::JointState& message);
  /// @return what keeps the axis from driving, in words.
  std::string troubleOf(const AxisStates& message, std::size_t index) const;
  AxisReport reportOf(const AxisStates& message, const DrivenAxis& axis) const;
  void publishOdometry(const ros::Time& stamp, const Twist& twist);
  void update();
  void send(const std::vector<double>& velocities);
  void moveSteering();
  void logState();
  void tell(Status& status);

  const BaseConfig config_;
  const DriverWheels wheels_;
  const std::string driver_;
  Drive drive_;
  Odometry odometry_;
  std::uint32_t joints_seq_ = 0;  // the last message of all joints had this number

  std::optional<Drive::State> logged_state_;
  std::string logged_cause_;
  bool driver_heard_ = false;
  bool was_ready_ = false;
  bool bad_command_ = false;  // the last one, which was said
  bool sideways_ = false;     // likewise
  std::optional<double> angle_to_send_;
  bool steering_asked_ = false;
  client::BackgroundCall steering_call_;

  ros_node::MasterDirectory directory_;
  ros_node::LatchedMessages latched_{directory_};
  ros::Publisher jog_publisher_;
  ros::Publisher odom_publisher_;
  std::optional<tf2_ros::TransformBroadcaster> broadcaster_;
  diagnostic_updater::Updater updater_;
  ros::Subscriber command_subscriber_;
  ros::Subscriber states_subscriber_;
  ros::Subscriber joints_subscriber_;
  ros::SteadyTimer update_timer_;
  ros::SteadyTimer diagnostics_timer_;
};

}  // namespace stepdriver::base
