#include "shared_motors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "profile/resting_count.h"

namespace stepdriver::pulse {

SharedMotors::SharedMotors(const SharedAxes& shared, std::vector<EngineChannel*> axes,
                           std::vector<EngineChannel*> motors)
    : matrix_(shared.matrix),
      inverse_(shared.inverse),
      axes_(std::move(axes)),
      motors_(std::move(motors)),
      sums_(motors_.size()) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i]->shared = motors_[i]->shared = this;
    motors_[i]->drives = true;
    // Its lines and times, without what is the axis's.
    const ChannelConfig& chip = axes_[i]->config;
    ChannelConfig& motor = motors_[i]->config;
    motor.step = chip.step;
    motor.dir = chip.dir;
    motor.dir_steps = chip.dir_steps;
    motor.both_edges = chip.both_edges;
    motor.step_high = chip.step_high;
    motor.step_low = chip.step_low;
    motor.dir_setup = chip.dir_setup;
    motor.dir_hold = chip.dir_hold;
    motor.late_steps = chip.late_steps;
    motors_[i]->pulse_line = motors_[i]->stepOf(0, motors_[i]->direction);
  }
  // Every axis needs all chips to be in order.
  Nanoseconds timeout = 0;
  bool ramps = false;
  for (const EngineChannel* axis : axes_) {
    timeout = std::max(timeout, axis->config.in_position_timeout);
    ramps = ramps || axis->config.ramps_at_fault;
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i]->config.in_position_timeout = timeout;
    axes_[i]->config.ramps_at_fault = ramps;
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      if (k == i) continue;
      MotorSignals& other = axes_[i]->config.twins.emplace_back();
      other.fault = axes_[k]->config.fault;
      other.in_position = axes_[k]->config.in_position;
    }
  }
}

bool SharedMotors::moves() const {
  return std::any_of(axes_.begin(), axes_.end(),
                     [](const EngineChannel* axis) { return axis->follows(); });
}

bool SharedMotors::isRunning() const {
  return std::any_of(axes_.begin(), axes_.end(),
                     [](const EngineChannel* axis) { return axis->follows() && axis->running; });
}

bool SharedMotors::isReserved() const {
  return std::any_of(axes_.begin(), axes_.end(),
                     [](const EngineChannel* axis) { return axis->reserved; });
}

Nanoseconds SharedMotors::restartInterval() const {
  Nanoseconds longest = 0;
  for (const EngineChannel* axis : axes_) longest = std::max(longest, axis->restart_interval);
  return longest;
}

bool SharedMotors::isFast(Nanoseconds motion_now) const {
  const Nanoseconds restart = restartInterval();
  return std::any_of(motors_.begin(), motors_.end(), [&](const EngineChannel* motor) {
    constexpr double kRounding = 1.0 + 1e-6;
    return std::abs(velocityOf(*motor, motion_now)) * static_cast<double>(restart) >
           1e9 * kRounding;
  });
}

double SharedMotors::velocityOf(const EngineChannel& motor, Nanoseconds motion_now) const {
  const auto number =
      static_cast<std::size_t>(std::find(motors_.begin(), motors_.end(), &motor) - motors_.begin());
  double velocity = 0.0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (!axes_[i]->follows()) continue;
    velocity += matrix_[number][i] * axes_[i]->profile.stateAt(motion_now).velocity;
  }
  return velocity;
}

int SharedMotors::fullStep() const {
  int least = std::numeric_limits<int>::max();
  for (const EngineChannel* axis : axes_) {
    if (axis->follows()) least = std::min(least, axis->full_step);
  }
  return least;
}

Nanoseconds SharedMotors::madeUntil() const {
  Nanoseconds until = std::numeric_limits<Nanoseconds>::min();
  if (!moves()) return until;
  for (const EngineChannel* motor : motors_) until = std::max(until, motor->last_planned);
  return until;
}

// ---- profiles ----

std::size_t SharedMotors::numberOf(const EngineChannel& axis) const {
  return static_cast<std::size_t>(std::find(axes_.begin(), axes_.end(), &axis) - axes_.begin());
}

// Each motor's steps from here on.
void SharedMotors::seed() {
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    EngineChannel& motor = *motors_[i];
    motion::ProfileSum& sum = sums_[i];
    sum.begin(std::max(motor.last_planned, since_));
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const EngineChannel& axis = *axes_[k];
      if (axis.follows()) {
        sum.add(matrix_[i][k], axis.profile);
      } else {
        sum.add(matrix_[i][k], motion::DoubleDouble(axis.state.rests_at));
      }
    }
    motor.finder = motion::StepFinder(sum, motor.state.count);
    motor.pullNext();
  }
}

void SharedMotors::begin(EngineChannel& axis, const Successors::Entry& followed) {
  const bool moved = moves();
  axis.adopt(followed);
  if (!moved) {
    since_ = followed.profile.startNs();
    for (EngineChannel* motor : motors_) {
      motor->last_planned = since_;
      motor->late = motor->behind = 0;
      motor->running = false;
    }
  }
  seed();
}

std::optional<Nanoseconds> SharedMotors::nextTakeOver() const {
  std::optional<Nanoseconds> first;
  for (const EngineChannel* axis : axes_) {
    if (axis->successors.empty()) continue;
    const Nanoseconds start = axis->successors.first().profile.startNs();
    first = std::min(first.value_or(start), start);
  }
  return first;
}

// Whether no step before a motion time is left to be made.
bool SharedMotors::isBefore(Nanoseconds time) const {
  return std::none_of(motors_.begin(), motors_.end(), [time](const EngineChannel* motor) {
    return motor->next && motor->next->time_ns < time;
  });
}

std::optional<Nanoseconds> SharedMotors::dueOf(const EngineChannel& axis) const {
  if (!axis.follows()) return std::nullopt;
  if (!axis.successors.empty()) {
    const Nanoseconds start = axis.successors.first().profile.startNs();
    return start == *nextTakeOver() && isBefore(start) ? std::optional<Nanoseconds>(start)
                                                       : std::nullopt;
  }
  const Nanoseconds end = axis.profile.endNs();
  if (nextTakeOver().value_or(end + 1) <= end) return std::nullopt;
  // A last step may be at the end itself; and the last pulses must be over.
  const bool pulses = std::any_of(motors_.begin(), motors_.end(),
                                  [](const EngineChannel* motor) { return motor->high; });
  return !pulses && isBefore(end + 1) ? std::optional<Nanoseconds>(end) : std::nullopt;
}

void SharedMotors::takeOver(EngineChannel& axis) {
  since_ = std::max(since_, axis.successors.first().profile.startNs());
  axis.adopt(axis.successors.takeFirst());
  seed();
}

void SharedMotors::finish(EngineChannel& axis) {
  since_ = std::max(since_, axis.profile.endNs());
  axis.state.rests_at = axis.profile.endPosition().value();
  for (motion::ProfileSum& sum : sums_) sum.rest(numberOf(axis));
}

void SharedMotors::halt() {
  for (EngineChannel* motor : motors_) {
    motor->next.reset();
    motor->publish();
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i]->state.rests_at = placeOf(i);
    axes_[i]->publish();
  }
}

// ---- steps ----

bool SharedMotors::isObsolete(const EngineChannel& motor) const {
  const auto replaced = nextTakeOver();
  return motor.next && replaced && motor.next->time_ns >= *replaced;
}

double SharedMotors::placeOf(std::size_t axis) const {
  double place = 0.0;
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    place += inverse_[axis][i] * static_cast<double>(motors_[i]->state.count);
  }
  return place;
}

void SharedMotors::stepped(const EngineChannel& motor) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    EngineChannel& axis = *axes_[i];
    ChannelState& state = axis.state;
    const double place = placeOf(i);
    state.count = motion::restingCount(place);
    state.between = place - static_cast<double>(state.count);
    axis.running = axis.follows();
    if (motors_[i] == &motor) {
      state.own = motor.state.count;
      state.pulses = motor.state.pulses;
      state.rose = motor.state.rose;
    }
    axis.publish();
  }
}

void SharedMotors::noteReady(Nanoseconds ready) {
  for (const auto* channels : {&axes_, &motors_}) {
    for (EngineChannel* channel : *channels) {
      channel->state.ready = std::max(channel->state.ready, ready);
      channel->publish();
    }
  }
}

}  // namespace stepdriver::pulse
