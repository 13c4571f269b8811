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

Move Axis::Impl::start(std::int64_t target, double velocity) {
  const pulse::ChannelState state = harvest();
  const motion::TrapezoidLimits speeds = limits(velocity);
  Motion motion;
  motion.move = ++moves_;
  motion.target = target;
  double duration = 0.0;
  const auto plan = [&](std::int64_t at) {
    motion::Profile profile = motion::planTrapezoid(at, state.count, target, speeds);
    duration = profile.duration().value();
    return profile;
  };
  try {
    follow(std::move(motion), plan);
  } catch (const std::range_error& error) {
    refuse(error.what());
  }
  return {moves_, positionOf(static_cast<double>(target)), duration};
}

Move Axis::Impl::checkedMove(double position, bool relative, double velocity) {
  refuseUnlessReadyToMove();
  if (!std::isfinite(position)) refuse("the position must be a finite number");
  if (!std::isfinite(velocity) || velocity < 0.0) {
    refuse("the velocity must be a finite number, above 0 or 0 for the maximum");
  }
  if (velocity > maxSpeed() * (1.0 + 1e-12)) {
    refuse("the velocity " + show(velocity, "/s") + " is above the maximum " +
           show(maxSpeed(), "/s"));
  }
  const std::int64_t count = harvest().count;
  const double goal = relative ? positionOf(static_cast<double>(count)) + position : position;
  refuseBeyondLimits(goal, "the position");
  const std::int64_t target = std::llround(countOf(goal));
  refuseIntoEndstop(target - count);
  return start(target, velocity > 0.0 ? std::min(velocity, maxSpeed()) : maxSpeed());
}

void Axis::Impl::decelerate(const std::string& stopped_by) {
  if (!moving()) return;
  const Motion& current = *log.latest();
  if (!current.stopped_by.empty()) return;
  const motion::Profile& before = *current.profile;
  const auto plan = [&](std::int64_t at) {
    return motion::planStop(at, before.stateAt(at), limits(maxSpeed()), current.target);
  };
  Motion stop;
  stop.move = current.move;
  stop.target = current.target;
  stop.begin_ns = current.begin_ns;
  stop.stopped_by = stopped_by;
  follow(std::move(stop), plan);
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
    if (enabled) writePins(pins.enable(false));
  } catch (...) {
    disabling = false;
    throw;
  }
  disabling = false;
  enabled = false;
  position_valid = false;  // nothing holds the motor
}

// A plan for a moment a little ahead; one that comes too late is made again for a later moment.
void Axis::Impl::follow(Motion motion, const std::function<motion::Profile(std::int64_t)>& plan) {
  // The speed that the motor takes and leaves without a ramp: the start speed, but at least what a
  // ramp from rest has after its first full step.
  const motion::TrapezoidLimits speeds = limits(maxSpeed());
  const double restart =
      std::max(speeds.start_speed,
               std::sqrt(2.0 * std::min(speeds.acceleration, speeds.deceleration) * microsteps));
  pulse::Command command;
  command.channel = channel;
  command.restart_interval = static_cast<pulse::Nanoseconds>(1e9 / restart);
  for (pulse::Nanoseconds lead = kLead;; lead *= 2) {
    motion.serial = command.serial = ++serial_;
    {
      const pulse::ClockHold hold(driver.clock());
      const pulse::ChannelState state = driver.engine().channel(channel);
      if (!motion.stopped_by.empty() && state.following == 0) return;
      const pulse::Nanoseconds now = driver.motionNow();
      pulse::Nanoseconds at = now + lead;
      if (motion.stopped_by.empty()) {
        // DIR is set when the profile is taken, and the chip may still be waking.
        const pulse::Nanoseconds dir = config.timing.dir_hold_ns + config.timing.dir_setup_ns;
        at = std::max(at + dir, now + (state.ready - driver.clock().now()) + dir);
        motion.begin_ns = at;
      }
      motion.profile = std::make_unique<const motion::Profile>(plan(at));
      command.profile = motion.profile.get();
      Motion sent{motion.serial,   motion.move,       motion.target,
                  motion.begin_ns, motion.stopped_by, std::move(motion.profile)};
      log.add(std::move(sent));
      driver.post(command);
    }
    pulse::ChannelState state;
    driver.waitFor([&] {
      state = driver.engine().channel(channel);
      return state.taken >= command.serial;
    });
    if (state.refused != command.serial) return;
    log.withdraw(command.serial);
    if (lead > kLongestLead) {
      refuse("the pulse thread doesn't keep up: it took a plan later than " + inMilliseconds(lead) +
             " after it was made");
    }
  }
}

}  // namespace stepdriver::axis
