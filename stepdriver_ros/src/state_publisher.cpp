#include "state_publisher.h"

#include <ros/console.h>

#include <algorithm>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kPollPeriod{10};
constexpr std::chrono::milliseconds kAxisStatePeriod{100};
constexpr int kQueueSize = 10;

/// The next of the times that a period gives; those that have gone by are left out, so that a late
/// thread publishes less and not in bursts.
template <typename Time, typename Duration>
Time nextTime(Time last, Duration period, Time now) {
  last += period;
  return last > now ? last : now + period;
}

/// Whether anything but the progress of a motion differs.
bool differ(const AxisStates& one, const AxisStates& other) {
  return one.enabled != other.enabled || one.asleep != other.asleep || one.idle != other.idle ||
         one.moving != other.moving || one.held != other.held || one.homed != other.homed ||
         one.position_valid != other.position_valid || one.microsteps != other.microsteps ||
         one.target != other.target || one.fault != other.fault ||
         one.position_note != other.position_note;
}

AxisStates read(const machine::Machine& machine) {
  AxisStates states;
  states.header.stamp = ros::Time::now();
  for (const auto& axis : machine.axes()) {
    const axis::AxisState state = axis->state();
    states.name.push_back(axis->config().name);
    states.enabled.push_back(state.enabled);
    states.asleep.push_back(state.asleep);
    states.idle.push_back(state.idle);
    states.moving.push_back(state.moving);
    states.held.push_back(state.held);
    states.homed.push_back(state.homed);
    states.position_valid.push_back(state.position_valid);
    states.microsteps.push_back(state.microsteps);
    states.position.push_back(state.position);
    states.velocity.push_back(state.velocity);
    states.target.push_back(state.target);
    states.fault.push_back(state.fault);
    states.position_note.push_back(state.position_note);
  }
  return states;
}

}  // namespace

StatePublisher::StatePublisher(ros::NodeHandle node, ros::NodeHandle private_node,
                               const machine::Machine& machine, double joint_state_rate)
    : machine_(machine),
      joint_state_period_(std::chrono::duration_cast<Clock::duration>(
          std::chrono::duration<double>(1.0 / joint_state_rate))),
      joint_state_publisher_(node.advertise<sensor_msgs::JointState>("joint_states", kQueueSize)),
      endstop_publisher_(private_node.advertise<Endstops>("endstops", kQueueSize, true)),
      axis_state_publisher_(private_node.advertise<AxisStates>("axis_states", kQueueSize, true)) {
  for (const auto& axis : machine.axes()) {
    joint_states_.name.push_back(axis->config().joint);
    endstops_.name.push_back(axis->config().name);
  }
  const std::size_t axes = machine.axes().size();
  joint_states_.position.resize(axes);
  joint_states_.velocity.resize(axes);
  endstops_.min.resize(axes);
  endstops_.max.resize(axes);
  endstops_unreadable_.resize(axes);
}

StatePublisher::~StatePublisher() { stop(); }

void StatePublisher::start() {
  thread_ = std::thread([this] { run(); });
}

void StatePublisher::stop() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  stop_asked_.notify_all();
  thread_.join();
}

void StatePublisher::run() {
  auto joint_states_due = Clock::now();
  auto poll_due = joint_states_due;
  auto axis_states_due = joint_states_due;
  do {
    const auto now = Clock::now();
    if (now >= joint_states_due) {
      publishJointStates();
      joint_states_due = nextTime(joint_states_due, joint_state_period_, now);
    }
    if (now >= poll_due) {
      publishEndstopsOnChange();
      const bool due = now >= axis_states_due;
      publishAxisStates(!due);
      if (due)
        axis_states_due = nextTime<Clock::time_point>(axis_states_due, kAxisStatePeriod, now);
      poll_due = nextTime<Clock::time_point>(poll_due, kPollPeriod, now);
    }
  } while (sleepUntil(std::min(joint_states_due, poll_due)));
  publishJointStates();
  publishEndstopsOnChange();
  publishAxisStates(false);
}

bool StatePublisher::sleepUntil(Clock::time_point time) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !stop_asked_.wait_until(lock, time, [this] { return stopping_; });
}

void StatePublisher::publishJointStates() {
  joint_states_.header.stamp = ros::Time::now();
  for (std::size_t i = 0; i < machine_.axes().size(); ++i) {
    const axis::AxisState state = machine_.axes()[i]->state();
    joint_states_.position[i] = state.position;
    joint_states_.velocity[i] = state.velocity;
  }
  joint_state_publisher_.publish(joint_states_);
}

void StatePublisher::publishEndstopsOnChange() {
  Endstops read = endstops_;
  for (std::size_t i = 0; i < machine_.axes().size(); ++i) {
    try {
      const axis::EndstopState state = machine_.axes()[i]->endstops();
      read.min[i] = state.min.value_or(false);
      read.max[i] = state.max.value_or(false);
      endstops_unreadable_[i] = false;
    } catch (const GpioError& error) {
      // What was read last stands; the other axes' switches are read all the same.
      if (!endstops_unreadable_[i]) ROS_ERROR_NAMED("endstops", "%s", error.what());
      endstops_unreadable_[i] = true;
    }
  }
  if (endstops_published_ && read.min == endstops_.min && read.max == endstops_.max) return;
  read.header.stamp = ros::Time::now();
  endstops_ = read;
  endstops_published_ = true;
  endstop_publisher_.publish(endstops_);
}

void StatePublisher::publishAxisStates(bool only_on_change) {
  AxisStates states = read(machine_);
  if (only_on_change && !differ(states, axis_states_)) return;
  axis_states_ = std::move(states);
  axis_state_publisher_.publish(axis_states_);
}

}  // namespace stepdriver::ros_node
