#include "state_publisher.h"

#include <pthread.h>
#include <ros/console.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "common/axis_words.h"
#include "node/actions/follow_joint_trajectory.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

// The polling periods for changes.
constexpr std::chrono::milliseconds kMovingPeriod{10};
constexpr std::chrono::milliseconds kRestPeriod{20};
constexpr std::chrono::milliseconds kAxisStatePeriod{100};
constexpr int kQueueSize = 10;

/// The next time of a periodic sequence; past ones are skipped, so that a late thread publishes
/// less often and not in bursts.
template <typename Time, typename Duration>
Time nextTime(Time last, Duration period, Time now) {
  last += period;
  return last > now ? last : now + period;
}

/// Whether anything except the progress of a motion differs.
bool differ(const axis::AxisState& one, const axis::AxisState& other) {
  return one.enabled != other.enabled || one.asleep != other.asleep || one.idle != other.idle ||
         one.powered != other.powered || one.brake_engaged != other.brake_engaged ||
         one.moving != other.moving || one.held != other.held || one.homed != other.homed ||
         one.position_valid != other.position_valid || one.microsteps != other.microsteps ||
         one.target != other.target || one.speed_override != other.speed_override ||
         one.fault != other.fault || one.endstops_met != other.endstops_met ||
         one.stopped_by != other.stopped_by || one.position_note != other.position_note;
}

}  // namespace

StatePublisher::StatePublisher(ros::NodeHandle node, ros::NodeHandle private_node,
                               const machine::Machine& machine, double joint_state_rate)
    : machine_(machine),
      joint_state_period_(std::chrono::duration_cast<Clock::duration>(
          std::chrono::duration<double>(1.0 / joint_state_rate))),
      joint_state_publisher_(node.advertise<sensor_msgs::JointState>("joint_states", kQueueSize)),
      controller_state_publisher_(
          private_node.advertise<action_msgs::JointTrajectoryControllerState>("state", kQueueSize)),
      endstop_publisher_(private_node.advertise<Endstops>("endstops", kQueueSize, true)),
      axis_state_publisher_(private_node.advertise<AxisStates>("axis_states", kQueueSize, true)) {
  for (const auto& axis : machine.axes()) {
    joint_states_.name.push_back(axis->config().joint);
    endstops_.name.push_back(axis->config().name);
    own_state_publishers_.push_back(
        private_node.advertise<AxisState>(axis->config().name + "/state", kQueueSize, true));
    driver_publishers_.emplace_back(ros::NodeHandle(private_node, axis->config().name),
                                    axis->state());
  }
  const std::size_t axes = machine.axes().size();
  joint_states_.position.resize(axes);
  joint_states_.velocity.resize(axes);
  endstops_.min.resize(axes);
  endstops_.max.resize(axes);
  endstops_unreadable_.resize(axes);
  states_.resize(axes);
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
  pthread_setname_np(pthread_self(), "states");
  auto joint_states_due = Clock::now();
  auto poll_due = joint_states_due;
  auto axis_states_due = joint_states_due;
  do {
    const auto now = Clock::now();
    readStates();
    if (now >= joint_states_due) {
      publishJointStates();
      joint_states_due = nextTime(joint_states_due, joint_state_period_, now);
    }
    if (now >= poll_due) {
      publishEndstopsOnChange();
      const bool moving = std::any_of(states_.begin(), states_.end(),
                                      [](const axis::AxisState& state) { return state.moving; });
      const bool due = now >= axis_states_due;
      // At rest nothing is repeated, except the periodic message for subscribers.
      publishStateOfEachAxis(due);
      publishDrivers();
      publishAxisStates(!due || (!moving && axis_state_publisher_.getNumSubscribers() == 0));
      if (due)
        axis_states_due = nextTime<Clock::time_point>(axis_states_due, kAxisStatePeriod, now);
      poll_due = nextTime<Clock::time_point>(poll_due, moving ? kMovingPeriod : kRestPeriod, now);
    }
  } while (sleepUntil(std::min(joint_states_due, poll_due)));
  readStates();
  publishJointStates();
  publishEndstopsOnChange();
  publishStateOfEachAxis(true);
  publishDrivers();
  publishAxisStates(false);
}

bool StatePublisher::sleepUntil(Clock::time_point time) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !stop_asked_.wait_until(lock, time, [this] { return stopping_; });
}

void StatePublisher::readStates() {
  states_read_ = ros::Time::now();
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const std::uint64_t met_before = states_[i].endstops_met;
    states_[i] = machine_.axes()[i]->state();
    if (states_[i].endstops_met != met_before) logEndstop(i);
  }
}

// If the next motion has begun already, its end is no longer known.
void StatePublisher::logEndstop(std::size_t axis) const {
  const std::string& what = states_[axis].stopped_by;
  ROS_WARN_NAMED("endstops", "%s: its motion has ended: %s",
                 machine_.axes()[axis]->config().name.c_str(),
                 what.empty() ? "an endstop was met" : what.c_str());
}

void StatePublisher::publishJointStates() {
  joint_states_.header.stamp = states_read_;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    joint_states_.position[i] = states_[i].position;
    joint_states_.velocity[i] = states_[i].velocity;
  }
  joint_state_publisher_.publish(joint_states_);
  if (controller_state_publisher_.getNumSubscribers() > 0) publishControllerState();
}

void StatePublisher::publishControllerState() {
  action_msgs::JointTrajectoryControllerState message;
  message.header.stamp = states_read_;
  message.joint_names = joint_states_.name;
  for (const axis::AxisState& state : states_) {
    message.desired.positions.push_back(state.planned);
    message.actual.positions.push_back(state.position);
    message.error.positions.push_back(state.planned - state.position);
    // The only velocity of an axis is that of its plan.
    message.desired.velocities.push_back(state.velocity);
    message.actual.velocities.push_back(state.velocity);
    message.error.velocities.push_back(0.0);
  }
  controller_state_publisher_.publish(message);
}

void StatePublisher::publishEndstopsOnChange() {
  bool changed = !endstops_published_;
  for (std::size_t i = 0; i < machine_.axes().size(); ++i) {
    try {
      const axis::EndstopState state = machine_.axes()[i]->endstops();
      const std::uint8_t min = state.min.value_or(false);
      const std::uint8_t max = state.max.value_or(false);
      changed = changed || min != endstops_.min[i] || max != endstops_.max[i];
      endstops_.min[i] = min;
      endstops_.max[i] = max;
      endstops_unreadable_[i] = false;
    } catch (const GpioError& error) {
      // The last reading stays; the other axes' switches are still read.
      if (!endstops_unreadable_[i]) ROS_ERROR_NAMED("endstops", "%s", error.what());
      endstops_unreadable_[i] = true;
    }
  }
  if (!changed) return;
  endstops_.header.stamp = ros::Time::now();
  endstops_published_ = true;
  endstop_publisher_.publish(endstops_);
}

void StatePublisher::publishAxisStates(bool only_on_change) {
  if (only_on_change &&
      std::equal(states_.begin(), states_.end(), published_states_.begin(), published_states_.end(),
                 [](const auto& now, const auto& then) { return !differ(now, then); })) {
    return;
  }
  published_states_ = states_;
  AxisStates message;
  message.header.stamp = states_read_;
  message.speed_override = states_.front().speed_override;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const axis::AxisState& state = states_[i];
    message.name.push_back(machine_.axes()[i]->config().name);
    message.enabled.push_back(state.enabled);
    message.asleep.push_back(state.asleep);
    message.powered.push_back(state.powered);
    message.brake_engaged.push_back(state.brake_engaged);
    message.idle.push_back(state.idle);
    message.moving.push_back(state.moving);
    message.held.push_back(state.held);
    message.homed.push_back(state.homed);
    message.position_valid.push_back(state.position_valid);
    message.microsteps.push_back(state.microsteps);
    message.position.push_back(state.position);
    message.velocity.push_back(state.velocity);
    message.target.push_back(state.target);
    message.fault.push_back(state.fault);
    message.remedy.push_back(state.remedy);
    message.motor.push_back(motorWords(state));
    message.state.push_back(stateWords(state));
    message.stopped_by.push_back(state.stopped_by);
    message.position_note.push_back(state.position_note);
  }
  axis_state_publisher_.publish(message);
}

void StatePublisher::publishDrivers() {
  for (std::size_t i = 0; i < states_.size(); ++i) {
    driver_publishers_[i].publish(states_[i], states_read_);
  }
}

// Call before publishAxisStates(), which then makes these states the known ones.
void StatePublisher::publishStateOfEachAxis(bool due) {
  const bool first = published_states_.empty();
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const axis::AxisState& state = states_[i];
    if (!first && !(due && state.moving) && !differ(state, published_states_[i])) continue;
    AxisState message;
    message.header.stamp = states_read_;
    message.enabled = state.enabled;
    message.asleep = state.asleep;
    message.powered = state.powered;
    message.brake_engaged = state.brake_engaged;
    message.idle = state.idle;
    message.moving = state.moving;
    message.held = state.held;
    message.homed = state.homed;
    message.position_valid = state.position_valid;
    message.microsteps = state.microsteps;
    message.position = state.position;
    message.planned = state.planned;
    message.skew = state.skew;
    message.velocity = state.velocity;
    message.speed_override = state.speed_override;
    message.target = state.target;
    message.time_left = state.time_left;
    message.fault = state.fault;
    message.remedy = state.remedy;
    message.stopped_by = state.stopped_by;
    message.position_note = state.position_note;
    own_state_publishers_[i].publish(message);
  }
}

}  // namespace stepdriver::ros_node
