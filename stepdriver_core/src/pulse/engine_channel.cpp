#include "engine_channel.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "profile/resting_count.h"
#include "shared_motors.h"

namespace stepdriver::pulse {

Nanoseconds EngineChannel::madeUntil() const {
  if (shared != nullptr) return shared->madeUntil();
  return follows() ? last_planned : std::numeric_limits<Nanoseconds>::min();
}

bool EngineChannel::isRunning() const {
  return shared != nullptr ? shared->isRunning() : follows() && running;
}

bool EngineChannel::isReserved() const {
  return shared != nullptr ? shared->isReserved() : reserved;
}

bool EngineChannel::has(std::optional<Signal> MotorSignals::*signal) const {
  for (std::size_t i = 0; i < motors(); ++i) {
    if (motor(i).*signal) return true;
  }
  return false;
}

std::int64_t EngineChannel::skewAfter(int step_direction) const {
  MotorCounts lags = state.lags;
  for (std::size_t i = 0; i < motors(); ++i) {
    if (isStill(i)) lags[i] -= step_direction;
  }
  return skewOf(lags, square_lags, motors());
}

void EngineChannel::pullNext() {
  motion::Step step;
  next.reset();
  if (finder.next(step)) next = step;
}

void EngineChannel::adopt(const Successors::Entry& followed) {
  profile = followed.profile;
  state.following = followed.serial;
  settles = followed.settles && has(&MotorSignals::in_position);
  if (shared == nullptr) {
    if (profile.shaper() == nullptr) {
      finder = motion::StepFinder(profile.profile(), state.count);
    } else {
      parts.begin(profile.startNs());
      parts.add(1.0, profile);
      finder = motion::StepFinder(parts, state.count);
    }
    pullNext();
  }
  // A plan without a step, as for another speed, doesn't begin the wait again.
  if (next || shared != nullptr) settling = false;
  look_at = 0;
}

Nanoseconds EngineChannel::restartInterval() const {
  return shared != nullptr ? shared->restartInterval() : restart_interval;
}

// A step's interval alone would be too long in a motion that speeds up, and the present speed alone
// in one that slows down.
Nanoseconds EngineChannel::angleAsTime(Nanoseconds motion_now) const {
  const double speed = std::abs(shared != nullptr ? shared->velocityOf(*this, motion_now)
                                                  : profile.stateAt(motion_now).velocity);
  const auto interval_ns = static_cast<double>(interval());
  const double step_ns = speed * interval_ns > 1e9 ? 1e9 / speed : interval_ns;
  const double angle_ns = config.late_steps * fullStep() * step_ns;
  return angle_ns < kLongestCatchUp ? static_cast<Nanoseconds>(angle_ns) : kLongestCatchUp;
}

int EngineChannel::fullStep() const { return shared != nullptr ? shared->fullStep() : full_step; }

void EngineChannel::follow(const Follow& order) {
  restart_interval = order.restart_interval;
  full_step = order.full_step;
  group = order.group;
  slows = order.slows;
  if (!follows()) {
    state.still = order.still;
    squares = order.squares;
    if (order.is_square) square_lags = state.lags;
    const Successors::Entry first{order.profile, order.serial, order.settles};
    shared != nullptr ? shared->begin(*this, first) : adopt(first);
    last_planned = order.profile.startNs();
    late = behind = 0;
    running = false;
  } else {
    successors.add({order.profile, order.serial, order.settles});
  }
}

bool EngineChannel::reserve() {
  if (follows() || reserved) return false;
  if (shared != nullptr && shared->moves()) return false;
  reserved = true;
  faulty = 0;  // it must be read again when the pins have been written
  return true;
}

void EngineChannel::release(const Command& command) {
  reserved = false;
  unchecked = has(&MotorSignals::fault);
  state.ready = std::max(state.ready, command.ready);
  if (shared != nullptr) shared->noteReady(command.ready);
  if (const auto& scale = command.scale) {
    state.count = scale->count;
    config.backlash = scale->backlash;
    takeUp(scale->taken_up);
    ++state.epoch;
  }
}

// In a mode whose microsteps don't divide the backlash, the last step that takes it up is a part of
// one: without the exact sum, each change of the mode would move the joint by what was rounded.
void EngineChannel::takeUp(double of_backlash) {
  state.taken_up = std::clamp(of_backlash, 0.0, config.backlash);
  state.slack = motion::restingCount(state.taken_up);
}

void EngineChannel::countStep() {
  state.count += direction;
  if (config.backlash > 0.0) takeUp(state.taken_up + direction);
  ++state.pulses;
  state.rose = rose;
  running = true;
  stepped = direction;
  last_planned = next->time_ns;
  late = 0;
  pullNext();
  if (isAlone()) return published.storeFirst<kStepBytes>(state);
  for (std::size_t i = 0; i < motors(); ++i) {
    if ((pulsed & motorBit(i)) == 0) state.lags[i] -= direction;
  }
  publish();
}

void EngineChannel::endMotion(EndReason reason, Nanoseconds motion_now) {
  // A failure after the end of a motion doesn't change how that motion ended.
  if (follows()) {
    state.end = reason;
    state.end_abrupt = shared != nullptr ? shared->ends_fast : isFast();
    state.ended = latest();
    state.end_time = motion_now;
  }
  state.following = 0;
  profile = {};
  squares = false;
  settling = false;
  successors.clear();
  next.reset();
  publish();
}

}  // namespace stepdriver::pulse
