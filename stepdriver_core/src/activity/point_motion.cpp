#include "point_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "point_to_point/acceleration_ramp_down.h"
#include "point_to_point/move_between.h"
#include "profile/position_range.h"
#include "profile/resting_count.h"
#include "setpoint_motion.h"

namespace stepdriver::activity {

// If the joint reaches its target upwards, all of the backlash is taken up there; if it reaches it
// downwards, nothing is. It depends on where the joint would stop, which the motor's place alone
// doesn't tell: part of the backlash may be open. At rest on its target it stays.
std::int64_t motorTarget(const axis::AxisModel& axis, const Goal& goal,
                         const motion::MotionState& from, const motion::MotionLimits& within) {
  const std::int64_t down = *goal.target;
  if (axis.backlash() == 0 || goal.of_motor) return down;
  const std::int64_t up = down + axis.backlash();
  const std::int64_t count = axis.motor.state().count;
  const double rest = axis.moving() ? motion::planStop(0, from, within).endPosition().value()
                                    : static_cast<double>(count);
  const double way = static_cast<double>(down) - axis.jointAt(rest);
  if (way != 0.0) return way > 0.0 ? up : down;
  if (!axis.moving()) return count;
  return from.velocity > 0.0 ? up : down;
}

std::optional<std::int64_t> standAt(const axis::AxisModel& axis, const Goal& goal) {
  std::optional<std::int64_t> stand_at = goal.target;
  if (stand_at && goal.velocity > 0.0) *stand_at += axis.backlash();
  return stand_at;
}

namespace {

motion::Plan planToCount(const axis::AxisModel& axis, const Goal& goal,
                         const motion::MotionState& from, std::int64_t at,
                         const motion::MotionLimits& within) {
  if (goal.kind == Goal::Kind::kSetpoint) return planSetpoint(axis, goal, from, at, within);
  if (goal.kind == Goal::Kind::kJog) {
    return motion::planVelocity(at, from, std::copysign(within.max_speed, goal.velocity), within,
                                standAt(axis, goal));
  }
  return motion::planMove(at, from, motorTarget(axis, goal, from, within), within);
}

motion::Plan planFrom(const axis::AxisModel& axis, const Goal& goal,
                      const motion::MotionState& from, std::int64_t at,
                      const motion::MotionLimits& within) {
  return axis::planBetween(goal.between(axis), from, [&](const motion::MotionState& seen) {
    return planToCount(axis, goal, seen, at, within);
  });
}

// With the overshoot of the joint: if it passes its target and returns, the motor goes back to a
// place before the one at which the joint first met its target, and may not seem to pass its own.
motion::Plan ofJoint(const axis::AxisModel& axis, const Goal& goal, const motion::MotionState& from,
                     motion::Plan plan) {
  if (goal.kind != Goal::Kind::kMove || goal.of_motor || axis.backlash() == 0) return plan;
  const double joint = axis.jointAt(from.position.value());
  const motion::Extent motor = motion::extentOf(plan.profile);
  const motion::Extent reached{
      std::min(joint, motor.lowest),
      std::max(joint, motor.highest - static_cast<double>(axis.backlash()))};
  plan.overshoot = motion::overshootOf(reached, joint, static_cast<double>(*goal.target));
  return plan;
}

// How far a motion goes beyond its target or a soft limit [microsteps].
double excessOf(const axis::AxisModel& axis, const Goal& goal, const motion::Plan& plan) {
  // To follow a stream of setpoints, an axis may have to pass the last one.
  double excess = goal.kind == Goal::Kind::kSetpoint ? 0.0 : plan.overshoot;
  if (goal.of_motor) return excess;  // no soft limit applies
  const motion::Extent extent = motion::extentOf(plan.profile);
  if (const auto& lowest = axis.config.min_position) {
    excess = std::max(excess, axis.countOf(*lowest) - extent.lowest);
  }
  if (const auto& highest = axis.config.max_position) {
    const double most = axis.countOf(*highest) + static_cast<double>(axis.backlash());
    excess = std::max(excess, extent.highest - most);
  }
  return excess;
}

// The limits of the motion under way, at a motion time of it.
motion::MotionLimits limitsAt(const axis::AxisModel& axis, const motor::Motion& motion,
                              std::int64_t at) {
  motion::MotionLimits limits = motion.limits;
  if (at >= motion.slows_ns) limits.jerk = axis.stopLimits().jerk;
  return limits;
}

bool areTheSame(const motion::MotionLimits& one, const motion::MotionLimits& other) {
  return one.acceleration == other.acceleration && one.deceleration == other.deceleration &&
         one.jerk == other.jerk;
}

}  // namespace

GoalPlan planGoal(const axis::AxisModel& axis, const Goal& goal, std::int64_t at) {
  const motion::MotionState from = axis.motor.stateAt(at);
  const bool slows_down = goal.runs() && goal.velocity == 0.0;
  const double velocity =
      slows_down ? axis.maxSpeed()
                 : std::min(std::abs(goal.velocity) * axis.mode.speed_override, axis.maxSpeed());
  const motion::MotionLimits within = axis.limits(velocity);
  const std::int64_t slows_ns =
      goal.kind == Goal::Kind::kSetpoint ? goal.setpoint.until_ns : motor::Motion::kNeverSlows;
  const motor::Motion* under_way = axis.motor.motions().latest();
  motion::MotionLimits before = under_way != nullptr ? limitsAt(axis, *under_way, at) : within;
  before.max_speed = within.max_speed;
  if (goal.kind == Goal::Kind::kSetpoint && at >= slows_ns) {
    if (axis.moving()) return {{planStop(axis, at)}, before, at};
    axis.refuse("no other setpoint came before the timeout");
  }
  if (areTheSame(before, within)) {
    return {ofJoint(axis, goal, from, planFrom(axis, goal, from, at, within)), within, slows_ns};
  }
  const motion::LevelOff level_off(at, from, within, before.jerk);
  GoalPlan changed{ofJoint(axis, goal, from,
                           level_off.followedBy(
                               planFrom(axis, goal, level_off.end(), level_off.endNs(), within))),
                   level_off.isNeeded() ? before : within, slows_ns};
  const double excess = excessOf(axis, goal, changed.plan);
  if (excess <= motion::kNoStep) return changed;
  GoalPlan kept{ofJoint(axis, goal, from, planFrom(axis, goal, from, at, before)), before,
                slows_ns};
  return excessOf(axis, goal, kept.plan) < excess ? kept : changed;
}

motion::Profile planStop(const axis::AxisModel& axis, std::int64_t at) {
  const motor::Motion& before = *axis.motor.motions().latest();
  const motion::MotionState from = before.planned.plan()->stateAt(at);
  const motion::MotionLimits stopping = axis.stopLimits();
  const motion::DoubleDouble end = before.planned.plan()->endPosition();
  // A motion that hasn't begun has nothing ahead of it, but one may be passing its end.
  const double way = (end - from.position).value();
  const bool ends_ahead = way * from.velocity > 0.0 || std::abs(way) < 0.5;
  if (before.overshoot > 0.0 || !ends_ahead) return motion::planStop(at, from, stopping);
  return motion::planStop(at, from, stopping, motion::restingCount(end.value()));
}

std::int64_t earliestStart(const Context& context, const axis::AxisModel& axis,
                           pulse::Nanoseconds lead) {
  const pulse::Nanoseconds now = context.motionNow();
  if (const motor::Motion* before = axis.motor.motions().latest()) {
    return std::max(now + lead, before->planned.plan()->startNs());
  }
  // DIR is set when the profile is accepted, and the chip may still be waking up.
  const pulse::Nanoseconds dir = axis.turnTime();
  return std::max(now + lead + dir, now + (axis.motor.state().ready - context.now) + dir);
}

std::int64_t stepsTo(const axis::AxisModel& axis, const Goal& goal) {
  if (goal.runs()) return goal.velocity > 0.0 ? 1 : -1;
  return *goal.target - axis.jointCount();
}

// Of an axis that shares motors: its place between the steps of all of them.
double restOf(const axis::AxisModel& axis, double end, const std::vector<Order>& together) {
  if (axis.sharers().empty()) return end;
  return axis.restWith([&](const axis::AxisModel& sharer) {
    if (&sharer == &axis) return end;
    for (const Order& order : together) {
      if (order.axis == &sharer && order.goal.target) return order.goal.end(sharer);
    }
    return sharer.plannedEnd();
  });
}

axis::Move moveOf(const axis::AxisModel& axis, const Goal& goal,
                  const motion::ShapedProfile& motion, double overshoot,
                  const std::vector<Order>& together) {
  axis::Move move;
  // A motion may reverse, which takes up the backlash again: the motor's end doesn't determine the
  // joint's.
  const bool jogs = goal.runs();
  const double rest =
      jogs || goal.of_motor ? axis.jointAt(motion.endPosition().value()) : goal.end(axis);
  move.rest = axis.positionOf(restOf(axis, rest, together));
  move.target = jogs ? axis.positionOf(rest)
                     : axis.positionOf(static_cast<double>(*goal.target) + goal.remainder);
  move.duration = static_cast<double>(motion.endNs() - motion.startNs()) / 1e9;
  move.overshoot = overshoot / axis.stepsPerUnit();
  return move;
}

}  // namespace stepdriver::activity
