#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "axis_impl.h"

namespace stepdriver::axis {
namespace {

// How far ahead of now a profile begins: time to plan it and to hand it over.
constexpr pulse::Nanoseconds kLead = 1'000'000;
constexpr pulse::Nanoseconds kLongestLead = 2'000'000'000;

}  // namespace

// ---- what was asked for ----

double Axis::Impl::checkedVelocity(double velocity) const {
  if (!std::isfinite(velocity) || velocity < 0.0) {
    refuse("the velocity must be a finite number, above 0 or 0 for the maximum");
  }
  refuseTooFast(velocity);
  return velocity > 0.0 ? std::min(velocity, maxSpeed()) : maxSpeed();
}

Move Axis::Impl::checkedMove(double position, bool relative, double velocity) {
  refuseUnlessReadyToMove();
  if (!std::isfinite(position)) refuse("the position must be a finite number");
  const double speed = checkedVelocity(velocity);
  const std::int64_t count = harvest().count;
  const double goal = relative ? positionOf(relativeOrigin(count)) + position : position;
  refuseBeyondLimits(goal, "the position");
  const std::int64_t target = std::llround(countOf(goal));
  if (!moving()) refuseIntoEndstop(target - count);
  return startMove(target, speed);
}

double Axis::Impl::relativeOrigin(std::int64_t count) {
  const Motion* current = underWay();
  if (current == nullptr) return static_cast<double>(count);
  if (current->goal.stops()) return current->profile->endPosition().value();
  if (!current->goal.target) refuse("busy: it jogs without an end; give an absolute position");
  return static_cast<double>(*current->goal.target);
}

Move Axis::Impl::startMove(std::int64_t target, double velocity) {
  Goal goal;
  goal.target = target;
  goal.velocity = velocity;
  const Motion& motion = begin(goal);
  const double duration =
      static_cast<double>(motion.profile->endNs() - motion.profile->startNs()) * 1e-9;
  return {motion.goal.move, positionOf(static_cast<double>(target)), duration,
          motion.overshoot / stepsPerUnit()};
}

void Axis::Impl::checkedJog(double velocity) {
  if (!std::isfinite(velocity)) refuse("the velocity must be a finite number");
  const Motion* current = underWay();
  if (velocity == 0.0) {
    if (current != nullptr && current->goal.kind == Goal::Kind::kJog) decelerate("the jog ended");
    return;
  }
  refuseUnlessReadyToMove();
  refuseTooFast(std::abs(velocity));
  Goal goal;
  goal.kind = Goal::Kind::kJog;
  goal.velocity = velocity;
  const auto& limit = velocity > 0.0 ? config.max_position : config.min_position;
  if (limit) goal.target = std::llround(countOf(*limit));
  const std::int64_t count = harvest().count;
  if (!moving()) {
    const std::int64_t sign = velocity > 0.0 ? 1 : -1;
    if (goal.target && (*goal.target - count) * sign <= 0) {
      refuse("it stands at the soft limit " + show(*limit) + "; it jogs only away from it");
    }
    refuseIntoEndstop(sign);
  } else if (current->goal.kind == Goal::Kind::kJog && !current->goal.stops() &&
             current->goal.velocity == velocity) {
    return;  // it does so already
  }
  begin(goal);
}

void Axis::Impl::decelerate(const std::string& stopped_by) {
  const Motion* current = underWay();
  if (current == nullptr || current->goal.stops()) return;
  Goal goal = current->goal;
  goal.stopped_by = stopped_by;
  follow(goal);
}

void Axis::Impl::changeOverride(double factor) {
  speed_override = factor;
  const Motion* current = underWay();
  if (current != nullptr && !current->goal.stops()) follow(Goal(current->goal));
}

void Axis::Impl::awaitRest(std::unique_lock<std::mutex>& lock, const std::string& stopped_by) {
  while (moving()) {
    decelerate(stopped_by);
    lock.unlock();
    driver.waitFor([this] { return driver.engine().channel(channel).following == 0; });
    lock.lock();
  }
}

void Axis::Impl::restAndDisable(std::unique_lock<std::mutex>& lock, const std::string& stopped_by) {
  if (!enabled) return;
  disabling = true;
  try {
    awaitRest(lock, stopped_by);
    if (isEnabled()) writePins(pins.enable(false));
    if (asleep != isAsleep()) writePins(pins.sleep(asleep));
  } catch (...) {
    disabling = false;
    throw;
  }
  disabling = false;
  enabled = false;
  idle = false;
  noteUnpowered();
}

// ---- orders to the engine ----

const Motion* Axis::Impl::underWay() { return moving() ? log.latest() : nullptr; }

const Motion& Axis::Impl::begin(Goal goal) {
  wake();
  goal.move = ++moves_;
  const Motion* before = underWay();
  const std::uint64_t replaced = before != nullptr ? before->goal.move : 0;
  const std::int64_t began = before != nullptr ? before->begin_ns : 0;
  follow(goal);
  harvest();
  const Motion& motion = *log.latest();
  if (replaced != 0 && !log.result(replaced)) log.conclude(replaced, replacedBy(motion, began));
  return motion;
}

MoveResult Axis::Impl::replacedBy(const Motion& motion, std::int64_t began) {
  MoveResult result;
  result.end = MoveEnd::kReplaced;
  result.position = positionOf(static_cast<double>(harvest().count));
  result.duration = std::max(0.0, static_cast<double>(motion.profile->startNs() - began) * 1e-9);
  result.message = config.name + " was at " + show(result.position) + " when ";
  if (motion.goal.kind == Goal::Kind::kJog) {
    result.message += "a jog took over";
  } else {
    result.message +=
        "a move to " + show(positionOf(static_cast<double>(*motion.goal.target))) + " took over";
  }
  return result;
}

motion::Plan Axis::Impl::plan(const Goal& goal, std::int64_t at, const Motion* before,
                              std::int64_t count) const {
  const motion::MotionState from = before != nullptr
                                       ? before->profile->stateAt(at)
                                       : motion::MotionState{motion::fromInteger(count), 0.0, 0.0};
  if (goal.stops()) return {planStopOf(*before, at, from)};
  const double velocity = std::min(std::abs(goal.velocity) * speed_override, maxSpeed());
  if (goal.kind == Goal::Kind::kMove) {
    return motion::planMove(at, from, *goal.target, limits(velocity));
  }
  return motion::planVelocity(at, from, std::copysign(velocity * stepsPerUnit(), goal.velocity),
                              limits(velocity), goal.target);
}

motion::Profile Axis::Impl::planStopOf(const Motion& before, std::int64_t at,
                                       const motion::MotionState& from) const {
  motion::MotionLimits stopping = limits(maxSpeed());
  stopping.deceleration = config.stop_deceleration.value_or(config.deceleration) * stepsPerUnit();
  const motion::DoubleDouble end = before.profile->endPosition();
  const bool ends_ahead = (end - from.position).value() * from.velocity >= 0.0;
  if (before.overshoot > 0.0 || !ends_ahead) return motion::planStop(at, from, stopping);
  return motion::planStop(at, from, stopping, std::llround(end.value()));
}

pulse::Nanoseconds Axis::Impl::restartInterval() const {
  // The speed that the motor takes and leaves without a ramp: the start speed, but at least what a
  // ramp from rest has after its first full step.
  const motion::MotionLimits speeds = limits(maxSpeed());
  const double restart =
      std::max(speeds.start_speed,
               std::sqrt(2.0 * std::min(speeds.acceleration, speeds.deceleration) * microsteps));
  return static_cast<pulse::Nanoseconds>(1e9 / restart);
}

// A plan for a moment a little ahead; one that comes too late is made again for a later moment.
void Axis::Impl::follow(const Goal& goal) {
  for (pulse::Nanoseconds lead = kLead;; lead *= 2) {
    const std::uint64_t serial = send(goal, lead);
    if (serial == 0) return;
    pulse::ChannelState state;
    driver.waitFor([&] {
      state = driver.engine().channel(channel);
      return state.taken >= serial;
    });
    if (state.refused != serial) return;
    log.withdraw(serial);
    if (lead > kLongestLead) {
      refuse("the pulse thread doesn't keep up: it took a plan later than " + inMilliseconds(lead) +
             " after it was made");
    }
    // What the plan began with may be over by now: the motion has met an endstop or a fault, say.
    if (!goal.stops()) {
      refuseUnlessReadyToMove();
      if (!moving()) refuseIntoEndstop(stepsTo(goal));
    }
  }
}

std::int64_t Axis::Impl::stepsTo(const Goal& goal) {
  if (goal.kind == Goal::Kind::kJog) return goal.velocity > 0.0 ? 1 : -1;
  return *goal.target - harvest().count;
}

std::uint64_t Axis::Impl::send(const Goal& goal, pulse::Nanoseconds lead) {
  const pulse::ClockHold hold(driver.clock());
  const pulse::ChannelState state = driver.engine().channel(channel);
  const Motion* before = state.following != 0 ? log.latest() : nullptr;
  if (goal.stops() && before == nullptr) return 0;
  const pulse::Nanoseconds now = driver.motionNow();
  pulse::Nanoseconds at = now + lead;
  Motion motion;
  motion.goal = goal;
  if (before != nullptr) {
    motion.continues = before->serial;
    at = std::max(at, before->profile->startNs());
  } else {
    // DIR is set when the profile is taken, and the chip may still be waking.
    const pulse::Nanoseconds dir = config.timing.dir_hold_ns + config.timing.dir_setup_ns;
    at = std::max(at + dir, now + (state.ready - driver.clock().now()) + dir);
  }
  const bool same_move = before != nullptr && before->goal.move == goal.move;
  motion.begin_ns = same_move ? before->begin_ns : at;
  try {
    motion::Plan plan = this->plan(goal, at, before, state.count);
    motion.overshoot = plan.overshoot;
    motion.profile = std::make_unique<const motion::Profile>(std::move(plan.profile));
  } catch (const std::range_error& error) {
    refuse(error.what());
  }
  pulse::Command command;
  command.channel = channel;
  command.serial = motion.serial = ++serial_;
  command.continues = motion.continues;
  command.profile = motion.profile.get();
  command.restart_interval = restartInterval();
  log.add(std::move(motion));
  driver.post(command);
  return command.serial;
}

}  // namespace stepdriver::axis
