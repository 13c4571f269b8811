#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "axis_impl.h"
#include "course.h"
#include "restart_speed.h"

namespace stepdriver::axis {
namespace {

// How far ahead of now a profile begins: time to plan it and to hand it over.
constexpr pulse::Nanoseconds kLead = 1'000'000;
constexpr pulse::Nanoseconds kLongestLead = 2'000'000'000;

}  // namespace

// ---- plans ----

motion::Plan Axis::Impl::plan(const Goal& goal, std::int64_t at) {
  const motion::MotionState from = stateAt(at);
  if (goal.slowsDown()) return {planStopOf(*underWay(), at, from)};
  const double velocity = std::min(std::abs(goal.velocity) * speed_override, maxSpeed());
  const motion::MotionLimits within = limits(velocity);
  if (goal.kind == Goal::Kind::kJog) {
    std::optional<std::int64_t> stand_at = goal.target;
    if (stand_at && goal.velocity > 0.0) *stand_at += backlash();
    return motion::planVelocity(at, from, std::copysign(velocity * stepsPerUnit(), goal.velocity),
                                within, stand_at);
  }
  return motion::planMove(at, from, motorTarget(goal, from, within), within);
}

// A joint that is to come to its target upwards has all of the backlash taken up there, downwards
// none of it. At rest on its target it stays, and a moving one comes to it from where it would
// stop.
std::int64_t Axis::Impl::motorTarget(const Goal& goal, const motion::MotionState& from,
                                     const motion::MotionLimits& within) {
  const std::int64_t down = *goal.target;
  if (backlash() == 0 || goal.of_motor) return down;
  const std::int64_t up = down + backlash();
  if (underWay() == nullptr) {
    const std::int64_t way = down - jointCount();
    return way > 0 ? up : way < 0 ? down : harvest().count;
  }
  const double rest = motion::planStop(0, from, within).endPosition().value();
  if (from.velocity > 0.0) return rest <= static_cast<double>(up) ? up : down;
  return rest >= static_cast<double>(down) ? down : up;
}

motion::Profile Axis::Impl::planStopOf(const Motion& before, std::int64_t at,
                                       const motion::MotionState& from) const {
  motion::MotionLimits stopping = limits(maxSpeed());
  stopping.deceleration = stopDeceleration();
  const motion::DoubleDouble end = before.profile->endPosition();
  // What hasn't begun to move has nothing ahead.
  const bool ends_ahead = (end - from.position).value() * from.velocity > 0.0;
  if (before.overshoot > 0.0 || !ends_ahead) return motion::planStop(at, from, stopping);
  return motion::planStop(at, from, stopping, std::llround(end.value()));
}

pulse::Nanoseconds Axis::Impl::restartInterval() const {
  return static_cast<pulse::Nanoseconds>(1e9 / (restartSpeed(config) * stepsPerUnit()));
}

// The path that the orders of one course share.
std::shared_ptr<const motion::Profile> Axis::Impl::planPath(const Orders& orders, std::int64_t at) {
  const Order& first = orders.front();
  Course& course = *first.goal.course;
  const Motion* before = first.axis->underWay();
  const auto shared = [](motion::Profile profile) {
    return std::make_shared<const motion::Profile>(std::move(profile));
  };
  const double factor = first.axis->speed_override;
  if (before != nullptr && before->goal.course == first.goal.course) {
    const motion::MotionState from = before->path->stateAt(at);
    return shared(first.goal.slowsDown() ? course.planStop(at, from)
                                         : course.plan(at, from, factor));
  }
  if (first.axis->held) {
    return shared(course.plan(at, {first.axis->held->path->endPosition(), 0.0, 0.0}, factor));
  }
  course.start(at);
  return shared(course.plan(at, course.begin(), factor));
}

Motion Axis::Impl::planned(const Goal& goal, std::int64_t at,
                           const std::shared_ptr<const motion::Profile>& path) {
  const Motion* before = underWay();
  Motion motion;
  motion.goal = goal;
  motion.serial = serial_ + 1;
  motion.continues = before != nullptr ? before->serial : 0;
  motion.begin_ns = at;
  if (before != nullptr && before->goal.move == goal.move) motion.begin_ns = before->begin_ns;
  if (held && held->goal.move == goal.move) motion.begin_ns = held->begin_ns;
  if (path != nullptr) {
    motion.path = path;
    motion.profile =
        std::make_unique<const motion::Profile>(goal.course->profileOf(goal.member, *path));
    return motion;
  }
  motion::Plan own = plan(goal, at);
  motion.overshoot = own.overshoot;
  motion.profile = std::make_unique<const motion::Profile>(std::move(own.profile));
  return motion;
}

// ---- orders to the engine ----

// A plan for a moment a little ahead; one that comes too late is made again for a later moment.
void Axis::Impl::carryOut(const Orders& orders) {
  Impl& first = *orders.front().axis;
  for (pulse::Nanoseconds lead = kLead;; lead *= 2) {
    // The engine reads these until it has taken them.
    const std::vector<pulse::Follow> follows = send(orders, lead);
    if (follows.empty()) return;
    first.driver.waitFor([&] {
      return std::all_of(orders.begin(), orders.end(), [&](const Order& order) {
        return order.axis->taken(follows[static_cast<std::size_t>(&order - orders.data())]);
      });
    });
    const auto state = first.driver.engine().channel(first.channel);
    if (state.refused != follows.front().serial) return;
    for (std::size_t i = 0; i < orders.size(); ++i) {
      orders[i].axis->log.withdraw(follows[i].serial);
    }
    if (lead > kLongestLead) {
      first.refuse("the pulse thread doesn't keep up: it took a plan later than " +
                   inMilliseconds(lead) + " after it was made");
    }
    // What the plan began with may be over by now: the motion has met an endstop or a fault, say.
    for (const auto& [axis, goal] : orders) {
      if (goal.slowsDown()) continue;
      axis->refuseUnlessReady();
      if (!axis->moving()) axis->refuseIntoEndstop(axis->stepsTo(goal));
    }
  }
}

bool Axis::Impl::taken(const pulse::Follow& follow) const {
  return driver.engine().channel(channel).taken >= follow.serial;
}

std::int64_t Axis::Impl::stepsTo(const Goal& goal) {
  if (goal.kind == Goal::Kind::kJog) return goal.velocity > 0.0 ? 1 : -1;
  return *goal.target - jointCount();
}

// The first motion time at which a new profile may begin.
pulse::Nanoseconds Axis::Impl::earliest(pulse::Nanoseconds now, pulse::Nanoseconds lead) {
  if (const Motion* before = underWay()) return std::max(now + lead, before->profile->startNs());
  // DIR is set when the profile is taken, and the chip may still be waking.
  const pulse::Nanoseconds dir = config.timing.dir_hold_ns + config.timing.dir_setup_ns;
  return std::max(now + lead + dir, now + (harvest().ready - driver.clock().now()) + dir);
}

/// @return what the engine is to follow; empty where nothing moves that could slow down.
std::vector<pulse::Follow> Axis::Impl::send(const Orders& orders, pulse::Nanoseconds lead) {
  pulse::PulseDriver& driver = orders.front().axis->driver;
  const pulse::ClockHold hold(driver.clock());
  const pulse::Nanoseconds now = driver.motionNow();
  pulse::Nanoseconds at = 0;
  for (const auto& [axis, goal] : orders) {
    if (goal.slowsDown() && axis->underWay() == nullptr) return {};
    at = std::max(at, axis->earliest(now, lead));
  }
  const std::shared_ptr<Course> course = orders.front().goal.course;
  std::vector<Motion> motions;
  try {
    const auto path = course != nullptr ? planPath(orders, at) : nullptr;
    for (const auto& [axis, goal] : orders) motions.push_back(axis->planned(goal, at, path));
  } catch (const std::range_error& error) {
    orders.front().axis->refuse(error.what());
  }
  std::vector<pulse::Follow> follows;
  for (std::size_t i = 0; i < orders.size(); ++i) {
    Impl& axis = *orders[i].axis;
    const Motion& motion = motions[i];
    follows.push_back({axis.channel, motion.serial, motion.profile.get(), motion.continues,
                       axis.restartInterval(), course != nullptr ? course->group() : 0});
    axis.serial_ = motion.serial;
    axis.log.add(std::move(motions[i]));
  }
  pulse::Command command;
  command.follows = follows.data();
  command.follow_count = follows.size();
  driver.post(command);
  return follows;
}

}  // namespace stepdriver::axis
