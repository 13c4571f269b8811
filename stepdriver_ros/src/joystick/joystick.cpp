#include "joystick.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <ros/transport_hints.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/Jog.h>

#include <cmath>
#include <utility>

#include "common/ask_service.h"

namespace stepdriver::joystick {
namespace {

// A stream of messages: an old one is useless when the next has arrived.
constexpr std::uint32_t kQueued = 1;
constexpr double kLogPeriod = 2.0;  // [s]

}  // namespace

Joystick::Joystick(ros::NodeHandle node, const std::string& driver, JoystickConfig config)
    : config_(std::move(config)) {
  for (const JogAxis& axis : config_.axes) {
    Jogged jogged;
    jogged.config = axis;
    jogged.service = fmt::format("{}/{}/enable", driver, axis.name);
    if (axis.disable_in_dead_band) {
      jogged.sequence = JogSequence::disabling(axis.disable_after);
      jogged.enable = std::make_unique<client::BackgroundCall>();
    }
    axes_.push_back(std::move(jogged));
  }
  publisher_ = node.advertise<Jog>(driver + "/jog", kQueued);
  subscriber_ = ros_node::subscribeToNew<sensor_msgs::Joy>(
      node, "joy", kQueued, latched_, [this](const auto& message) { onMessage(*message); },
      ros::TransportHints().tcpNoDelay());
  timer_ = node.createSteadyTimer(ros::WallDuration(1.0 / config_.rate),
                                  [this](const ros::SteadyTimerEvent& /*event*/) {
                                    endWithoutMessages();
                                    send();
                                  });
}

void Joystick::rest() {
  for (Jogged& axis : axes_) axis.velocity = 0.0;
  send();
}

void Joystick::onMessage(const sensor_msgs::Joy& message) {
  heard_ = ros::SteadyTime::now();
  const std::string mistake = mistakeIn(message);
  if (!mistake.empty()) {
    ROS_ERROR_THROTTLE_NAMED(kLogPeriod, "joystick", "joy: %s", mistake.c_str());
  }
  const bool jogs = mistake.empty() && deadmanHeld(message);
  bool changed = false;
  for (Jogged& axis : axes_) {
    const double velocity =
        jogs ? velocityOf(axis.config.stick, message.axes[axis.config.joystick_axis]) : 0.0;
    changed = changed || velocity != axis.velocity;
    axis.velocity = velocity;
  }
  if (changed) send();
}

std::string Joystick::mistakeIn(const sensor_msgs::Joy& message) const {
  for (const Jogged& axis : axes_) {
    const auto index = static_cast<std::size_t>(axis.config.joystick_axis);
    if (index >= message.axes.size()) {
      return fmt::format(
          "the message has {} axes, but {} is jogged by joystick_axis {}, counted from 0: nothing "
          "jogs",
          message.axes.size(), axis.config.name, index);
    }
    if (!std::isfinite(message.axes[index])) {
      return fmt::format(
          "axis {} of the message, which jogs {}, is {}, but must be a finite number: nothing jogs",
          index, axis.config.name, message.axes[index]);
    }
  }
  if (config_.deadman_button >= static_cast<int>(message.buttons.size())) {
    return fmt::format(
        "the message has {} buttons, but deadman_button is {}, counted from 0: nothing jogs",
        message.buttons.size(), config_.deadman_button);
  }
  return {};
}

bool Joystick::deadmanHeld(const sensor_msgs::Joy& message) const {
  return config_.deadman_button < 0 || message.buttons[config_.deadman_button] != 0;
}

void Joystick::endWithoutMessages() {
  if (heard_.isZero() || ros::SteadyTime::now() - heard_ < ros::WallDuration(config_.joy_timeout)) {
    return;
  }
  heard_ = ros::SteadyTime();
  for (Jogged& axis : axes_) {
    if (axis.velocity == 0.0) continue;
    ROS_WARN_NAMED("joystick", "%s: no message from the joystick for %g s, so the jog ends",
                   axis.config.name.c_str(), config_.joy_timeout);
    axis.velocity = 0.0;
  }
}

void Joystick::send() {
  const double now = ros::SteadyTime::now().toSec();
  Jog message;
  for (Jogged& axis : axes_) {
    if (axis.enable) takeAnswer(axis, now);
    const JogOrders orders = axis.sequence.orders(axis.velocity, now);
    if (orders.enable) callEnable(axis, *orders.enable);
    if (!orders.velocity) continue;
    message.name.push_back(axis.config.name);
    message.velocity.push_back(*orders.velocity);
  }
  if (message.name.empty()) return;
  message.header.stamp = ros::Time::now();
  publisher_.publish(message);
}

void Joystick::callEnable(const Jogged& axis, bool on) {
  std_srvs::SetBool::Request request;
  request.data = on;
  axis.enable->start([service = axis.service, request] {
    return client::askService<std_srvs::SetBool>(service, request);
  });
}

void Joystick::takeAnswer(Jogged& axis, double now) {
  const auto answer = axis.enable->takeAnswer();
  if (!answer) return;
  axis.sequence.answered(answer->success, now);
  if (answer->success) return;
  ROS_ERROR_THROTTLE_NAMED(kLogPeriod, "joystick", "%s: %s", axis.service.c_str(),
                           answer->message.c_str());
}

}  // namespace stepdriver::joystick
