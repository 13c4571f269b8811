#include "point_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "point_to_point/acceleration_ramp_down.h"
#include "point_to_point/approach.h"
#include "point_to_point/move_between.h"
#include "profile/position_range.h"
#include "profile/profile_parts.h"
#include "profile/resting_count.h"
#include "setpoint_motion.h"
#include "trajectory/backlash.h"

namespace stepdriver::activity {

// If the joint reaches its target upwards, all of the backlash is taken up there; if it reaches it
// downwards, nothing is. It depends on where the joint would stop, which the motor's place alone
// doesn't tell: part of the backlash may be open. At rest on its target it stays.
namespace {

// The part of the backlash that is taken up when the motor has gone a way in one direction.
double slackAfter(const axis::AxisModel& axis, double slack, double way) {
  return std::clamp(slack + way, 0.0, static_cast<double>(axis.backlash()));
}

}  // namespace

std::int64_t motorTarget(const axis::AxisModel& axis, const Goal& goal,
                         const motion::MotionState& from, double slack,
                         const motion::MotionLimits& within) {
  const std::int64_t down = *goal.target;
  if (axis.backlash() == 0 || goal.of_motor) return down;
  const std::int64_t up = down + axis.backlash();
  const std::int64_t count = axis.motor.state().count;
  double joint = axis.jointAt(static_cast<double>(count));
  if (axis.moving()) {
    const double rest = motion::planStop(0, from, within).endPosition().value();
    joint = rest - slackAfter(axis, slack, rest - from.position.value());
  }
  const double way = static_cast<double>(down) - joint;
  if (way != 0.0) return way > 0.0 ? up : down;
  if (!axis.moving()) return count;
  return from.velocity > 0.0 ? up : down;
}

std::int64_t limitTarget(const axis::AxisModel& axis, std::int64_t limit, bool up,
                         const motion::MotionState& from, const motion::MotionLimits& within) {
  if (!up || axis.backlash() == 0) return limit;
  // If it can't stop before the limit, it comes back to it, and opens the backlash.
  const double rest = from.position.value() +
                      motion::Stop(from.velocity, from.acceleration, within).length().value();
  const bool passes = axis.jointAt(rest) - static_cast<double>(limit) > motion::kNoStep;
  return passes ? limit : limit + axis.backlash();
}

std::optional<std::int64_t> limitAhead(const axis::AxisModel& axis, const motion::MotionState& from,
                                       const motion::MotionLimits& within) {
  const bool up = from.velocity > 0.0;
  const auto& limit = up ? axis.config.max_position : axis.config.min_position;
  if (!limit) return std::nullopt;
  return limitTarget(axis, motion::restingCount(axis.countOf(*limit)), up, from, within);
}

std::optional<std::int64_t> standAt(const axis::AxisModel& axis, const Goal& goal,
                                    const motion::MotionState& from,
                                    const motion::MotionLimits& within) {
  if (!goal.target) return std::nullopt;
  return limitTarget(axis, *goal.target, goal.velocity > 0.0, from, within);
}

namespace {

motion::Plan planAfterStop(const axis::AxisModel& axis, const Goal& goal,
                           const motion::MotionState& from, double slack, std::int64_t at,
                           const motion::MotionLimits& stopping,
                           const motion::MotionLimits& within);

// Whether the joint is at the goal when the motor's motion has ended. With a jerk limit a motor
// that turns doesn't come to rest there, and turns before the place where it would: the joint may
// not have come as far as the motor's target relies on.
bool leadsJointTo(const axis::AxisModel& axis, const Goal& goal, const motion::MotionState& from,
                  double slack, const motion::Profile& profile) {
  if (axis.backlash() == 0 || goal.of_motor) return true;
  const motion::PositionRange extent = motion::positionRangeOf(profile);
  const double turn = from.velocity < 0.0 ? extent.lowest : extent.highest;
  const double end = profile.endPosition().value();
  const double there = slackAfter(axis, slack, turn - from.position.value());
  const double joint = end - slackAfter(axis, there, end - turn);
  return std::abs(joint - static_cast<double>(*goal.target)) <= motion::kNoStep;
}

motion::Plan planToCount(const axis::AxisModel& axis, const Goal& goal,
                         const motion::MotionState& from, double slack, std::int64_t at,
                         const motion::MotionLimits& within) {
  if (goal.kind == Goal::Kind::kSetpoint) return planSetpoint(axis, goal, from, slack, at, within);
  if (goal.kind == Goal::Kind::kJog) {
    return motion::planVelocity(at, from, std::copysign(within.max_speed, goal.velocity), within,
                                standAt(axis, goal, from, within));
  }
  motion::Plan plan =
      motion::planMove(at, from, motorTarget(axis, goal, from, slack, within), within);
  if (from.velocity == 0.0 || leadsJointTo(axis, goal, from, slack, plan.profile)) return plan;
  return planAfterStop(axis, goal, from, slack, at, within, within);
}

motion::Plan planFrom(const axis::AxisModel& axis, const Goal& goal,
                      const motion::MotionState& from, double slack, std::int64_t at,
                      const motion::MotionLimits& within) {
  return motion::planBetween(goal.between(axis), from, [&](const motion::MotionState& seen) {
    return planToCount(axis, goal, seen, slack, at, within);
  });
}

double secondsOf(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

// The way on which the motions under way lead the motor until another one takes over.
struct WayUntil {
  double from = 0.0;  // [microsteps] its place now
  motion::PositionRange extent;
};

WayUntil wayUntil(const axis::AxisModel& axis, std::int64_t now, std::int64_t at) {
  const auto count = static_cast<double>(axis.motor.state().count) + axis.motor.state().between;
  WayUntil way{count, {count, count}};
  const auto& motions = axis.motor.motions().all();
  bool any = false;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const motion::ShapedProfile made = motions[i].planned.made();
    const motion::Profile& profile = made.profile();
    const std::int64_t until =
        i + 1 < motions.size() ? motions[i + 1].planned.plan()->startNs() : at;
    if (made.startNs() <= now && now < until) way.from = made.stateAt(now).position.value();
    // Each part of a shaped motion follows its plan later; their sum stays within the plan.
    const std::int64_t late = made.shaper() != nullptr ? made.shaper()->durationNs() : 0;
    const std::int64_t begin = std::max(now - late, profile.startNs());
    const std::int64_t end = std::min(until, profile.endNs());
    if (begin >= end) continue;
    const motion::PositionRange ahead = motion::positionRangeOf(motion::part(
        profile, secondsOf(begin - profile.startNs()), secondsOf(end - profile.startNs())));
    if (!std::exchange(any, true)) way.extent = ahead;
    way.extent.lowest = std::min(way.extent.lowest, ahead.lowest);
    way.extent.highest = std::max(way.extent.highest, ahead.highest);
  }
  return way;
}

// The part of the backlash that is taken up when a motion takes over.
double slackAtStart(const axis::AxisModel& axis, const motion::MotionState& from, std::int64_t at) {
  const pulse::ChannelState& state = axis.motor.state();
  const auto last = static_cast<double>(state.slack);
  const motor::Motion* const under_way = axis.motor.motions().latest();
  if (under_way == nullptr) return last;
  const auto known = motion::slackAt(*under_way->planned.plan(), at, axis.backlash());
  if (known) return *known;
  // The motor hasn't come over the whole backlash, and has turned once at most: after the last step
  // that is known, or before it, which changes nothing here.
  const auto count = static_cast<double>(state.count);
  const double place = from.position.value();
  const std::int64_t begin = axis.motor.motions().all().front().planned.plan()->startNs();
  const motion::PositionRange way = wayUntil(axis, begin, at).extent;
  const double turn = from.velocity < 0.0 ? std::max({way.highest, count, place})
                                          : std::min({way.lowest, count, place});
  return slackAfter(axis, slackAfter(axis, last, turn - count), place - turn);
}

// With the overshoot of the joint as its caller sees it, from the place where it is now: until the
// plan begins, it may already have passed the target. If a joint with a backlash passes its target
// and returns, the motor goes back to a place before the one at which the joint first met its
// target, and may not seem to pass its own.
motion::Plan ofJoint(const axis::AxisModel& axis, const Goal& goal, std::int64_t now,
                     motion::Plan plan) {
  if (goal.kind != Goal::Kind::kMove || goal.of_motor || !axis.moving()) return plan;
  const WayUntil before = wayUntil(axis, now, plan.profile.startNs());
  const double joint = axis.jointAt(before.from);
  const motion::PositionRange after = motion::positionRangeOf(plan.profile);
  const auto backlash = static_cast<double>(axis.backlash());
  const motion::PositionRange reached{
      std::min({joint, before.extent.lowest, after.lowest}),
      std::max({joint, before.extent.highest - backlash, after.highest - backlash})};
  plan.overshoot = motion::overshootOf(reached, joint, goal.end(axis));
  return plan;
}

// How far a motion goes beyond a soft limit [microsteps].
double beyondLimits(const axis::AxisModel& axis, const Goal& goal, const motion::Plan& plan) {
  if (goal.of_motor) return 0.0;  // no soft limit applies
  double beyond = 0.0;
  const motion::PositionRange extent = motion::positionRangeOf(plan.profile);
  if (const auto& lowest = axis.config.min_position) {
    beyond = std::max(beyond, axis.countOf(*lowest) - extent.lowest);
  }
  if (const auto& highest = axis.config.max_position) {
    const double most = axis.countOf(*highest) + static_cast<double>(axis.backlash());
    beyond = std::max(beyond, extent.highest - most);
  }
  return beyond;
}

// How far a motion goes beyond its target or a soft limit [microsteps].
double excessOf(const axis::AxisModel& axis, const Goal& goal, const motion::Plan& plan) {
  // To follow a stream of setpoints, an axis may have to pass the last one.
  const double overshoot = goal.kind == Goal::Kind::kSetpoint ? 0.0 : plan.overshoot;
  return std::max(overshoot, beyondLimits(axis, goal, plan));
}

// The limits of the motion under way, at a motion time of it.
motion::MotionLimits limitsAt(const axis::AxisModel& axis, const motor::Motion& motion,
                              std::int64_t at) {
  motion::MotionLimits limits = motion.limits;
  if (at >= motion.slows_ns) limits.jerk = axis.stopLimits().jerk;
  return limits;
}

// How far a motion leads in a direction [microsteps].
double reachOf(const motion::Profile& profile, double direction) {
  const motion::PositionRange extent = motion::positionRangeOf(profile);
  return direction > 0.0 ? extent.highest : -extent.lowest;
}

// The axis still moves away from where a goal leads it. Setpoints may be passed.
bool turnsBack(const Goal& goal, const motion::MotionState& from, const motion::Profile& profile) {
  const double way = (profile.endPosition() - from.position).value();
  return goal.kind != Goal::Kind::kSetpoint && way * from.velocity < 0.0;
}

// It comes to rest within one set of limits, and then moves to its goal within another.
motion::Plan planAfterStop(const axis::AxisModel& axis, const Goal& goal,
                           const motion::MotionState& from, double slack, std::int64_t at,
                           const motion::MotionLimits& stopping,
                           const motion::MotionLimits& within) {
  const motion::Profile stop = motion::planStop(at, from, stopping);
  motion::MotionState rest;
  rest.position = stop.endPosition();
  const double slack_there = slackAfter(axis, slack, (rest.position - from.position).value());
  motion::Plan plan = planFrom(axis, goal, rest, slack_there, stop.endNs(), within);
  std::vector<motion::Piece> pieces;
  for (const motion::Piece& piece : stop.pieces()) pieces.push_back(piece);
  for (const motion::Piece& piece : plan.profile.pieces()) pieces.push_back(piece);
  if (!pieces.empty()) plan.profile = motion::Profile(at, std::move(pieces));
  return plan;
}

bool areTheSame(const motion::MotionLimits& one, const motion::MotionLimits& other) {
  return one.acceleration == other.acceleration && one.deceleration == other.deceleration &&
         one.jerk == other.jerk;
}

}  // namespace

GoalPlan planGoal(const axis::AxisModel& axis, const Goal& goal, std::int64_t now,
                  std::int64_t at) {
  const motion::MotionState from = axis.motor.stateAt(at);
  const double slack = slackAtStart(axis, from, at);
  const bool slows_down = goal.runs() && goal.velocity == 0.0;
  const double factor = goal.ignores_override ? 1.0 : axis.mode.speed_override;
  const double velocity =
      slows_down ? axis.maxSpeed() : std::min(std::abs(goal.velocity) * factor, axis.maxSpeed());
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
  const auto plan_within = [&](const motion::MotionLimits& limits) -> GoalPlan {
    return {ofJoint(axis, goal, now, planFrom(axis, goal, from, slack, at, limits)), limits,
            slows_ns};
  };
  const auto best_within = [&]() -> GoalPlan {
    if (areTheSame(before, within)) return plan_within(within);
    const motion::AccelerationRampDown ramp_down(at, from, within, before.jerk);
    const motion::MotionState ramped = ramp_down.end();
    const double slack_there = slackAfter(axis, slack, (ramped.position - from.position).value());
    GoalPlan changed{
        ramp_down.followedBy(planFrom(axis, goal, ramped, slack_there, ramp_down.endNs(), within)),
        ramp_down.isNeeded() ? before : within, slows_ns};
    if (turnsBack(goal, from, changed.plan.profile)) {
      motion::Plan turned = planAfterStop(axis, goal, from, slack, at, before, within);
      if (reachOf(turned.profile, from.velocity) < reachOf(changed.plan.profile, from.velocity)) {
        changed = {std::move(turned), before, slows_ns};
      }
    }
    changed.plan = ofJoint(axis, goal, now, std::move(changed.plan));
    const double excess = excessOf(axis, goal, changed.plan);
    if (excess <= motion::kNoStep) return changed;
    GoalPlan kept = plan_within(before);
    return excessOf(axis, goal, kept.plan) < excess ? kept : changed;
  };
  GoalPlan best = best_within();
  // The motion under way may have relied on a stop, as at the timeout of setpoints, which is harder
  // than its limits.
  const double beyond = beyondLimits(axis, goal, best.plan);
  if (beyond <= motion::kNoStep || under_way == nullptr) return best;
  motion::MotionLimits stopping = axis.stopLimits();
  stopping.max_speed = within.max_speed;
  GoalPlan hardest = plan_within(stopping);
  return beyondLimits(axis, goal, hardest.plan) < beyond ? hardest : best;
}

motion::Profile planStop(const axis::AxisModel& axis, std::int64_t at) {
  const motor::Motion& before = *axis.motor.motions().latest();
  const motion::MotionState from = before.planned.plan()->stateAt(at);
  const motion::MotionLimits stopping = axis.stopLimits();
  const motion::DoubleDouble end = before.planned.plan()->endPosition();
  // A motion that hasn't begun has nothing ahead of it, but one may be passing its end.
  const double way = (end - from.position).value();
  const bool ends_ahead = way * from.velocity > 0.0 || std::abs(way) < 0.5;
  if (before.overshoot > 0.0 || !ends_ahead) {
    // It was planned to turn within the soft limit. What it rests on is a whole step, which may be
    // the next one.
    return motion::planStop(at, from, stopping, limitAhead(axis, from, stopping));
  }
  const std::int64_t count = motion::restingCount(end.value());
  const double between = axis.sharers().empty() ? 0.0 : end.value() - static_cast<double>(count);
  return motion::planBetween(between, from,
                             [&](const motion::MotionState& seen) {
                               return motion::Plan{motion::planStop(at, seen, stopping, count)};
                             })
      .profile;
}

std::int64_t earliestStart(const Context& context, const axis::AxisModel& axis,
                           pulse::Nanoseconds lead) {
  const pulse::Nanoseconds now = context.motionNow();
  const pulse::Nanoseconds first = now + context.horizon + lead;
  if (const motor::Motion* before = axis.motor.motions().latest()) {
    return std::max(first, before->planned.plan()->startNs());
  }
  // DIR is set when the profile is accepted, and the chip may still be waking up.
  const pulse::Nanoseconds dir = axis.turnTime();
  return std::max(first + dir, now + (axis.motor.state().ready - context.now) + dir);
}

std::int64_t stepsTo(const axis::AxisModel& axis, const Goal& goal) {
  if (goal.runs()) return goal.velocity > 0.0 ? 1 : -1;
  return *goal.target - axis.jointCount();
}

// The place of an axis that shares motors, between the steps of all of them.
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
