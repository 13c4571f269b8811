#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/steady_timer.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/Joy.h>

#include <memory>
#include <string>
#include <vector>

#include "common/background_call.h"
#include "common/latched_messages.h"
#include "common/master_directory.h"
#include "jog_sequence.h"
#include "joystick_config.h"

namespace stepdriver::joystick {

/// Turns the topic `joy` into the driver's `jog`, and calls the `enable` services of its axes.
///
/// Repeats the velocities of deflected sticks at the configured rate; each message of the joystick
/// takes effect at once. A message that can't be understood, or no message for the configured time,
/// ends all jogs. Its callbacks run in one thread, which also creates it and calls rest().
class Joystick {
 public:
  /// @param driver full name of the node that drives the axes.
  Joystick(ros::NodeHandle node, const std::string& driver, JoystickConfig config);
  Joystick(const Joystick&) = delete;
  Joystick& operator=(const Joystick&) = delete;

  /// Ends all jogs.
  void rest();

  /// See LatchedMessages. Any thread.
  bool lookAgain() { return latched_.lookAgain(); }

 private:
  struct Jogged {
    JogAxis config;
    std::string service;
    double velocity = 0.0;
    JogSequence sequence;
    std::unique_ptr<client::BackgroundCall> enable;  ///< if the axis is disabled in the dead band
  };

  void onMessage(const sensor_msgs::Joy& message);
  /// @return the mistake in a message; empty: no mistake.
  std::string mistakeIn(const sensor_msgs::Joy& message) const;
  bool deadmanHeld(const sensor_msgs::Joy& message) const;
  void endWithoutMessages();
  void send();
  static void callEnable(const Jogged& axis, bool on);
  void takeAnswer(Jogged& axis, double now);

  const JoystickConfig config_;
  std::vector<Jogged> axes_;
  ros::SteadyTime heard_;  // time of the last message; zero: there is none, or it has timed out
  ros_node::MasterDirectory directory_;
  ros_node::LatchedMessages latched_{directory_};
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::joystick
