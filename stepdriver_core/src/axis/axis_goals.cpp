#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "axis_impl.h"
#include "course.h"
#include "homing.h"

namespace stepdriver::axis {

// ---- what was asked for ----

double Axis::Impl::checkedVelocity(double velocity) const {
  if (!std::isfinite(velocity) || velocity < 0.0) {
    refuse("the velocity must be a finite number, above 0 or 0 for the maximum");
  }
  refuseTooFast(velocity);
  return velocity > 0.0 ? std::min(velocity, maxSpeed()) : maxSpeed();
}

std::int64_t Axis::Impl::checkedTarget(double position, bool relative) {
  refuseUnlessReadyToMove();
  if (!relative) refuseUnlessHomed();
  if (!std::isfinite(position)) refuse("the position must be a finite number");
  const double goal = relative ? positionOf(relativeOrigin()) + position : position;
  refuseBeyondLimits(goal, "the position");
  return std::llround(countOf(goal));
}

Goal Axis::Impl::checkedGoal(double position, bool relative, double velocity) {
  Goal goal;
  goal.target = checkedTarget(position, relative);
  goal.velocity = checkedVelocity(velocity);
  if (!moving()) refuseIntoEndstop(*goal.target - jointCount());
  return goal;
}

Move Axis::Impl::checkedMove(double position, bool relative, double velocity) {
  return begin({{this, checkedGoal(position, relative, velocity)}}).front();
}

double Axis::Impl::relativeOrigin() {
  const Motion* current = underWay();
  if (current == nullptr) return static_cast<double>(jointCount());
  if (current->goal.stops()) return jointAt(current->profile->endPosition().value());
  if (!current->goal.target) refuse("busy: it jogs without an end; give an absolute position");
  return static_cast<double>(*current->goal.target);
}

Move Axis::Impl::startMove(std::int64_t target, double velocity) {
  Goal goal;
  goal.target = target;
  goal.velocity = velocity;
  return begin({{this, goal}}).front();
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
  const std::int64_t count = jointCount();
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
  begin({{this, goal}});
}

Move Axis::Impl::moveMotor(std::int64_t target) {
  Goal goal;
  goal.target = target;
  goal.velocity = maxSpeed();
  goal.of_motor = true;
  return begin({{this, goal}}).front();
}

void Axis::Impl::takeUpBacklash(std::unique_lock<std::mutex>& lock, std::int64_t way) {
  const std::int64_t wanted = way > 0 ? backlash() : 0;
  if (way == 0 || harvest().slack == wanted) return;
  moveMotor(jointCount() + wanted);
  lock.unlock();
  driver.waitFor([this] { return driver.engine().channel(channel).following == 0; });
  lock.lock();
  harvest();
}

Orders Axis::Impl::ordersOf(const Goal& goal) {
  if (goal.course == nullptr) return {{this, goal}};
  Orders orders;
  for (Impl* axis : goal.course->axes()) {
    Goal own = axis == this ? goal : Goal();
    if (const Motion* motion = axis->log.latest()) own = motion->goal;
    if (axis->held) own = axis->held->goal;
    orders.push_back({axis, std::move(own)});
  }
  return orders;
}

void Axis::Impl::decelerate(const std::string& stopped_by) {
  interruptHoming(stopped_by);
  slowDown(stopped_by);
}

void Axis::Impl::slowDown(const std::string& stopped_by) {
  const Motion* current = underWay();
  if (current == nullptr) {
    dropHeld(MoveEnd::kStopped, stopped_by);
    return;
  }
  if (current->goal.stops()) return;
  Orders orders = ordersOf(current->goal);
  for (Order& order : orders) {
    order.goal.stopped_by = stopped_by;
    order.goal.held = false;
  }
  carryOut(orders);
  for (const Order& order : orders) {
    if (order.axis->log.latest()->goal.stops()) order.axis->held.reset();
  }
  dropHeld(MoveEnd::kStopped, stopped_by);  // it came to rest before the order came
}

bool Axis::Impl::leads() {
  const Motion* current = underWay();
  const Course* course = held                 ? held->goal.course.get()
                         : current != nullptr ? current->goal.course.get()
                                              : nullptr;
  return course == nullptr || course->axes().front() == this;
}

void Axis::Impl::hold() {
  if (homing != nullptr) homing->hold();
  const Motion* current = underWay();
  if (current == nullptr || current->goal.slowsDown()) return;
  if (current->goal.kind == Goal::Kind::kJog) {
    decelerate("it was held, which ends a jog");
    return;
  }
  Orders orders = ordersOf(current->goal);
  for (Order& order : orders) order.goal.held = true;
  carryOut(orders);
  for (const Order& order : orders) {
    Impl& axis = *order.axis;
    const Motion* slowing = axis.log.latest();
    if (!slowing->goal.held || axis.log.result(slowing->goal.move)) continue;  // ended before that
    axis.held = Held{slowing->goal, slowing->begin_ns, slowing->path};
    axis.held->goal.held = false;
  }
}

void Axis::Impl::resume() {
  harvest();
  if (!held) {
    if (homing != nullptr) homing->goOn();
    return;
  }
  const Orders orders = ordersOf(held->goal);
  for (const Order& order : orders) {
    order.axis->refuseUnlessReady();
    if (!order.axis->moving()) order.axis->refuseIntoEndstop(order.axis->stepsTo(order.goal));
  }
  carryOut(orders);
  for (const Order& order : orders) order.axis->held.reset();
  if (homing != nullptr) homing->goOn();
}

void Axis::Impl::dropHeld(MoveEnd end, const std::string& why) {
  if (!held) return;
  const std::shared_ptr<Course> course = held->goal.course;
  const std::vector<Impl*> axes = course ? course->axes() : std::vector<Impl*>{this};
  for (Impl* axis : axes) {
    if (!axis->held || axis->held->goal.course != course) continue;
    const Held given_up = *std::exchange(axis->held, std::nullopt);
    MoveResult result;
    result.end = axis == this ? end : MoveEnd::kCompanion;
    const pulse::ChannelState state = driver.engine().channel(axis->channel);
    result.position = axis->positionOf(static_cast<double>(state.count - state.slack));
    result.duration = std::max(0.0, static_cast<double>(state.end_time - given_up.begin_ns) * 1e-9);
    result.message = axis->standsAt(
        given_up.goal,
        axis == this ? why : "it was held together with " + config.name + ": " + why);
    axis->log.conclude(given_up.goal.move, result);
  }
}

void Axis::Impl::changeOverride(double factor) {
  speed_override = factor;
  const Motion* current = underWay();
  if (current == nullptr || current->goal.slowsDown()) return;
  if (leads()) carryOut(ordersOf(current->goal));
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
  interruptHoming(stopped_by);
  disabling = true;
  try {
    awaitRest(lock, stopped_by);
    dropHeld(MoveEnd::kStopped, stopped_by);
    if (isEnabled()) writeEnable(false);
    if (asleep != isAsleep()) writePins(pins.sleep(asleep));
  } catch (...) {
    disabling = false;
    throw;
  }
  disabling = false;
  enabled = false;
  idle = false;
}

// ---- one goal after another ----

const Motion* Axis::Impl::underWay() { return moving() ? log.latest() : nullptr; }

std::uint64_t Axis::Impl::currentMove() {
  if (const Motion* motion = underWay()) return motion->goal.move;
  return held ? held->goal.move : 0;
}

motion::MotionState Axis::Impl::stateAt(std::int64_t at) {
  if (const Motion* motion = underWay()) return motion->profile->stateAt(at);
  const pulse::ChannelState state = harvest();
  const motion::DoubleDouble count = motion::fromInteger(state.count);
  // A stop on a path rests between two microsteps: the next motion goes on from there.
  const Motion* last = log.find(state.ended);
  if (last == nullptr || state.end != pulse::EndReason::kDone) return {count, 0.0, 0.0};
  const motion::DoubleDouble rest = last->profile->endPosition();
  return {std::abs((rest - count).value()) <= 0.5 ? rest : count, 0.0, 0.0};
}

std::vector<Move> Axis::Impl::begin(Orders orders) {
  struct Replaced {
    Goal goal;
    std::int64_t began = 0;
  };
  std::vector<Replaced> replaced;
  for (const Order& order : orders) order.axis->wake();
  for (Order& order : orders) {
    order.goal.move = ++order.axis->moves_;
    const Motion* before = order.axis->underWay();
    replaced.push_back(before != nullptr ? Replaced{before->goal, before->begin_ns} : Replaced());
  }
  carryOut(orders);
  std::vector<Move> moves;
  for (std::size_t i = 0; i < orders.size(); ++i) {
    Impl& axis = *orders[i].axis;
    axis.harvest();
    const Motion& motion = *axis.log.latest();
    const Goal& before = replaced[i].goal;
    if (before.move != 0 && !axis.log.result(before.move)) {
      axis.log.conclude(before.move, axis.replacedBy(motion, replaced[i].began));
    }
    moves.push_back(axis.moveOf(*motion.profile, motion.overshoot));
    moves.back().id = motion.goal.move;
  }
  for (std::size_t i = 0; i < orders.size(); ++i) {
    orders[i].axis->leaveCourse(replaced[i].goal, orders[i].axis->config.name);
  }
  return moves;
}

// An axis that was given another goal has left the others of its course, and they can't go on
// without it.
void Axis::Impl::leaveCourse(const Goal& goal, const std::string& left_by) {
  if (goal.course == nullptr) return;
  for (Impl* axis : goal.course->axes()) {
    const Motion* motion = axis->underWay();
    if (motion == nullptr || motion->goal.course != goal.course || motion->goal.stops()) continue;
    Goal alone = motion->goal;
    alone.kind = Goal::Kind::kMove;
    alone.course = nullptr;
    alone.stopped_by = left_by + ", which it moved together with, was given another goal";
    carryOut({{axis, alone}});
  }
}

MoveResult Axis::Impl::replacedBy(const Motion& motion, std::int64_t began) {
  MoveResult result;
  result.end = MoveEnd::kReplaced;
  result.position = position();
  result.duration = std::max(0.0, static_cast<double>(motion.profile->startNs() - began) * 1e-9);
  result.message = config.name + " was at " + show(result.position) + " when ";
  if (motion.goal.kind == Goal::Kind::kJog) {
    result.message += "a jog took over";
  } else if (motion.goal.kind == Goal::Kind::kTogether) {
    result.message += "a motion together with other axes took over";
  } else {
    result.message +=
        "a move to " + show(positionOf(static_cast<double>(*motion.goal.target))) + " took over";
  }
  return result;
}

}  // namespace stepdriver::axis
