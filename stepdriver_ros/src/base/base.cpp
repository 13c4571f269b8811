#include "base.h"

#include <fmt/format.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/console.h>
#include <ros/names.h>
#include <ros/time.h>
#include <ros/transport_hints.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveTo.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/ask_service.h"

namespace stepdriver::base {
namespace {

// A stream of messages: an old one is useless when the next has arrived.
constexpr std::uint32_t kNewest = 1;
// Each of these counts: changes of state follow each other, and each odometry is a sample.
constexpr std::uint32_t kSeveral = 10;
constexpr double kDiagnosticsPeriod = 1.0;  // [s]
constexpr double kTooTightLogPeriod = 5.0;  // [s]
constexpr std::size_t kColumns = 6;         // a covariance has 6 by 6 numbers

double steadyNow() { return ros::SteadyTime::now().toSec(); }

std::vector<std::string> axisNames(const DriverWheels& wheels) {
  std::vector<std::string> names;
  for (const DrivenAxis& wheel : wheels.wheels) names.push_back(wheel.axis);
  return names;
}

template <typename Covariance>
void setDiagonal(Covariance& covariance, const Variances& variances) {
  covariance.fill(0.0);
  for (std::size_t i = 0; i < variances.size(); ++i) covariance[i * (kColumns + 1)] = variances[i];
}

/// The index of a name, or the size if it isn't there.
std::size_t indexOf(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// The first number of a command that isn't finite, in words; empty if all of them are.
std::string badNumberIn(const geometry_msgs::Twist& twist) {
  const std::pair<const char*, double> numbers[] = {
      {"linear.x", twist.linear.x},   {"linear.y", twist.linear.y},
      {"linear.z", twist.linear.z},   {"angular.x", twist.angular.x},
      {"angular.y", twist.angular.y}, {"angular.z", twist.angular.z}};
  for (const auto& [name, number] : numbers) {
    if (!std::isfinite(number)) return fmt::format("{} is {}", name, number);
  }
  return {};
}

}  // namespace

Base::Base(ros::NodeHandle node, const std::string& driver, BaseConfig config, DriverWheels wheels)
    : config_(std::move(config)),
      wheels_(std::move(wheels)),
      driver_(driver),
      drive_(wheels_.kinematics, axisNames(wheels_), wheels_.steering.axis, driver,
             {config_.cmd_vel_timeout, config_.driver_timeout}),
      odometry_(wheels_.kinematics) {
  jog_publisher_ = node.advertise<Jog>(driver + "/jog", kNewest);
  odom_publisher_ = node.advertise<nav_msgs::Odometry>("odom", kSeveral);
  if (config_.publish_tf) broadcaster_.emplace();
  updater_.setHardwareID(driver);
  updater_.add("wheels", [this](Status& status) { tell(status); });
  const auto no_delay = ros::TransportHints().tcpNoDelay();
  command_subscriber_ = ros_node::subscribeToNew<geometry_msgs::Twist>(
      node, "cmd_vel", kNewest, latched_, [this](const auto& message) { takeCommand(*message); },
      no_delay);
  states_subscriber_ = node.subscribe<AxisStates>(
      driver + "/axis_states", kSeveral,
      [this](const AxisStates::ConstPtr& message) { takeStates(*message); }, {}, no_delay);
  joints_subscriber_ = node.subscribe<sensor_msgs::JointState>(
      ros::names::append(ros::names::parentNamespace(driver), "joint_states"), kSeveral,
      [this](const sensor_msgs::JointState::ConstPtr& message) { takeJoints(*message); }, {},
      no_delay);
  update_timer_ =
      node.createSteadyTimer(ros::WallDuration(1.0 / config_.rate),
                             [this](const ros::SteadyTimerEvent& /*event*/) { update(); });
  diagnostics_timer_ = node.createSteadyTimer(
      ros::WallDuration(kDiagnosticsPeriod),
      [this](const ros::SteadyTimerEvent& /*event*/) { updater_.force_update(); });
}

void Base::rest() {
  const DriveOrders orders = drive_.rest();
  if (!orders.wheels.empty()) send(orders.wheels);
}

void Base::takeCommand(const geometry_msgs::Twist& message) {
  const std::string bad = badNumberIn(message);
  if (!bad.empty() && !bad_command_) {
    ROS_ERROR_NAMED("base", "cmd_vel: %s, but must be a finite number: the message is ignored",
                    bad.c_str());
  }
  bad_command_ = !bad.empty();
  if (bad_command_) return;
  const bool sideways = message.linear.y != 0.0;
  if (sideways && !sideways_) {
    ROS_WARN_NAMED("base",
                   "cmd_vel: linear.y is %g, which is ignored: these wheels can't move the "
                   "base sideways",
                   message.linear.y);
  }
  sideways_ = sideways;
  drive_.command({message.linear.x, message.angular.z}, steadyNow());
}

void Base::takeStates(const AxisStates& message) {
  std::vector<AxisReport> reports;
  for (const DrivenAxis& wheel : wheels_.wheels) reports.push_back(reportOf(message, wheel));
  AxisReport steering;
  if (wheels_.kinematics.steering) steering = reportOf(message, wheels_.steering);
  driver_heard_ = true;
  drive_.speedOverrideIs(message.speed_override);
  drive_.report(reports, steering, steadyNow());
}

AxisReport Base::reportOf(const AxisStates& message, const DrivenAxis& axis) const {
  const std::size_t index = indexOf(message.name, axis.axis);
  if (index == message.name.size()) return {"it is no longer an axis of " + driver_, false};
  return {troubleOf(message, index), message.moving.at(index) != 0};
}

std::string Base::troubleOf(const AxisStates& message, std::size_t index) const {
  if (!message.fault.at(index).empty()) return message.fault[index];
  if (message.held.at(index) != 0) return fmt::format("on hold; call {}/resume", driver_);
  // An idle axis wakes up for its next motion.
  if (message.idle.at(index) != 0) return {};
  if (message.asleep.at(index) != 0) {
    return fmt::format("asleep; call {}/{}/sleep with false", driver_, message.name[index]);
  }
  if (message.enabled.at(index) == 0) {
    return fmt::format("disabled; call {}/{}/enable with true", driver_, message.name[index]);
  }
  return {};
}

void Base::takeJoints(const sensor_msgs::JointState& message) {
  std::vector<double> positions;
  std::vector<double> velocities;
  const auto add = [&](const std::string& joint) {
    const std::size_t index = indexOf(message.name, joint);
    if (index >= std::min(message.position.size(), message.velocity.size())) return false;
    positions.push_back(message.position[index]);
    velocities.push_back(message.velocity[index]);
    return true;
  };
  // Other nodes publish their joints on the same topic.
  for (const DrivenAxis& wheel : wheels_.wheels) {
    if (!add(wheel.joint)) return;
  }
  double angle = 0.0;
  if (wheels_.kinematics.steering) {
    if (!add(wheels_.steering.joint)) return;
    angle = positions.back();
    positions.pop_back();
    velocities.pop_back();
    drive_.steeringIsAt(angle);
  }
  // The numbers of a publisher's messages grow, so this is another one.
  if (message.header.seq < joints_seq_) {
    ROS_WARN_NAMED("base", "%s has started again: odom continues from its last pose",
                   driver_.c_str());
    odometry_.forgetPositions();
  }
  joints_seq_ = message.header.seq;
  odometry_.moveTo(positions, angle);
  publishOdometry(message.header.stamp, twistFrom(wheels_.kinematics, velocities, angle));
}

void Base::publishOdometry(const ros::Time& stamp, const Twist& twist) {
  const Pose& pose = odometry_.pose();
  nav_msgs::Odometry odometry;
  odometry.header.stamp = stamp;
  odometry.header.frame_id = config_.odom_frame;
  odometry.child_frame_id = config_.base_frame;
  odometry.pose.pose.position.x = pose.x;
  odometry.pose.pose.position.y = pose.y;
  odometry.pose.pose.orientation.z = std::sin(pose.yaw / 2.0);
  odometry.pose.pose.orientation.w = std::cos(pose.yaw / 2.0);
  setDiagonal(odometry.pose.covariance, config_.pose_variances);
  odometry.twist.twist.linear.x = twist.linear;
  odometry.twist.twist.angular.z = twist.angular;
  setDiagonal(odometry.twist.covariance, config_.twist_variances);
  odom_publisher_.publish(odometry);
  if (!broadcaster_) return;
  geometry_msgs::TransformStamped transform;
  transform.header = odometry.header;
  transform.child_frame_id = config_.base_frame;
  transform.transform.translation.x = pose.x;
  transform.transform.translation.y = pose.y;
  transform.transform.rotation = odometry.pose.pose.orientation;
  broadcaster_->sendTransform(transform);
}

void Base::update() {
  const DriveOrders orders = drive_.orders(steadyNow());
  logState();
  if (drive_.takeTimedOut()) {
    ROS_INFO_NAMED("base", "No cmd_vel for %g s, so the base comes to rest",
                   config_.cmd_vel_timeout);
  }
  if (drive_.takeTooTight()) {
    ROS_WARN_THROTTLE_NAMED(kTooTightLogPeriod, "base",
                            "cmd_vel: the steering can't turn that far, so the turn is wider");
  }
  if (!orders.wheels.empty()) send(orders.wheels);
  if (orders.steering) angle_to_send_ = orders.steering;
  if (drive_.state() != Drive::State::kReady) angle_to_send_.reset();
  moveSteering();
}

void Base::send(const std::vector<double>& velocities) {
  Jog message;
  message.header.stamp = ros::Time::now();
  for (std::size_t i = 0; i < velocities.size(); ++i) {
    message.name.push_back(wheels_.wheels[i].axis);
    message.velocity.push_back(velocities[i]);
  }
  jog_publisher_.publish(message);
}

void Base::moveSteering() {
  if (const auto answer = steering_call_.takeAnswer()) {
    steering_asked_ = false;
    if (!answer->success) drive_.steeringRefused(answer->message);
  }
  if (steering_asked_ || !angle_to_send_) return;
  MoveTo::Request request;
  request.position = *std::exchange(angle_to_send_, std::nullopt);
  steering_asked_ = true;
  steering_call_.start([service = fmt::format("{}/{}/move_to", driver_, wheels_.steering.axis),
                        request] { return client::askService<MoveTo>(service, request); });
}

void Base::logState() {
  const Drive::State state = drive_.state();
  if (logged_state_ == state && logged_cause_ == drive_.cause()) return;
  logged_state_ = state;
  logged_cause_ = drive_.cause();
  if (state == Drive::State::kReady) {
    ROS_INFO_NAMED("base", was_ready_ ? "Takes cmd_vel again" : "Ready: drives by cmd_vel");
    was_ready_ = true;
  } else if (state == Drive::State::kWaiting) {
    ROS_WARN_NAMED("base",
                   "The cause is over. cmd_vel is taken again when it has paused for %g s "
                   "or sent 0",
                   config_.cmd_vel_timeout);
  } else if (was_ready_) {
    ROS_ERROR_NAMED("base", "All wheels stop: %s", logged_cause_.c_str());
  } else if (driver_heard_) {
    ROS_WARN_NAMED("base", "Not ready: %s", logged_cause_.c_str());
  } else {
    ROS_INFO_NAMED("base", "Not ready: %s", logged_cause_.c_str());
  }
}

void Base::tell(Status& status) {
  switch (drive_.state()) {
    case Drive::State::kReady:
      status.summary(Status::OK, "takes cmd_vel");
      break;
    case Drive::State::kStopped:
      status.summary(Status::ERROR, "stopped: " + drive_.cause());
      break;
    case Drive::State::kWaiting:
      status.summary(Status::WARN,
                     "waits until cmd_vel pauses or sends 0, after: " + drive_.cause());
      break;
  }
  const Pose& pose = odometry_.pose();
  status.add("x [m]", pose.x);
  status.add("y [m]", pose.y);
  status.add("yaw [rad]", pose.yaw);
}

}  // namespace stepdriver::base
