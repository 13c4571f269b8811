#include "follow_setpoints.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "message_text.h"
#include "nanoseconds.h"
#include "point_to_point/setpoint_stream.h"
#include "profile/resting_count.h"
#include "streamed_start.h"

namespace stepdriver::machine {
namespace {

std::optional<activity::Goal> positionGoal(const RequestContext& machine, axis::AxisModel& moved,
                                           double position, double timeout) {
  // Without a setpoint the axis returns to the last one after a period, but not sooner than this:
  // messages come irregularly.
  constexpr std::int64_t kLeastPatience = 10'000'000;
  moved.refuseUnlessHomed();
  if (moved.config.max_position) position = std::min(position, *moved.config.max_position);
  if (moved.config.min_position) position = std::max(position, *moved.config.min_position);
  moved.refuseBeyondLimits(position, "the position");
  const std::int64_t now = machine.context.motionNow();
  activity::Goal goal;
  goal.kind = activity::Goal::Kind::kSetpoint;
  goal.velocity = moved.maxSpeed();
  activity::Setpoint& setpoint = goal.setpoint;
  setpoint.of_position = true;
  setpoint.position = moved.countOf(position);
  goal.target = motion::restingCount(setpoint.position);
  goal.remainder = setpoint.position - static_cast<double>(*goal.target);
  const motion::SetpointStream::Course course =
      moved.setpoints.add(setpoint.position, now, nanoseconds(timeout), moved.stops);
  setpoint.velocity = course.velocity;
  setpoint.period = static_cast<double>(course.period_ns) * 1e-9;
  setpoint.reach_ns = course.came_ns + course.period_ns;
  setpoint.return_ns = setpoint.reach_ns + std::max(course.period_ns, kLeastPatience);
  setpoint.until_ns = now + nanoseconds(timeout);
  if (!moved.moving()) {
    const std::int64_t distance = *goal.target - moved.jointCount();
    if (distance == 0) return std::nullopt;
    moved.refuseIntoEndstop(distance);
  }
  return goal;
}

std::optional<activity::Goal> velocityGoal(const RequestContext& machine,
                                           const axis::AxisModel& moved, double value,
                                           double timeout) {
  moved.refuseTooFast(std::abs(value));
  const double velocity = velocityOrRest(moved, value);
  // As with a jog, 0 leaves other motions alone.
  const activity::Goal* current = streamedGoal(machine, moved);
  const bool follows = current != nullptr && current->kind == activity::Goal::Kind::kSetpoint;
  if (velocity == 0.0 && !follows) return std::nullopt;
  activity::Goal goal;
  goal.kind = activity::Goal::Kind::kSetpoint;
  goal.velocity = velocity;
  goal.setpoint.until_ns = machine.context.motionNow() + nanoseconds(timeout);
  if (velocity != 0.0) limitVelocity(goal, moved, "moves");
  return goal;
}

}  // namespace

std::string FollowSetpoints::text(const AxisWords& axes) const {
  return joinedText(setpoints, [&](const Setpoint& setpoint) {
    return fmt::format("setpoint of {}: {} {}{}", axes.name(setpoint.axis),
                       numberText(setpoint.value), axes.unit(setpoint.axis),
                       mode == SetpointMode::kVelocity ? "/s" : "");
  });
}

void FollowSetpoints::serve(RequestContext& machine, const SharedCall& call) const {
  beginStreamed(
      machine, setpoints, call, [&](const Setpoint& setpoint, const SharedCall& /*part*/) {
        axis::AxisModel& moved = machine.axis(setpoint.axis);
        const bool is_position = mode == SetpointMode::kPosition;
        moved.refuseUnlessFinite("setpoint", setpoint.value, is_position ? "" : "/s");
        if (moved.stops != setpoint.unless_stopped_since.value_or(moved.stops)) {
          moved.refuse(
              is_position
                  ? "the setpoints were stopped; let them pause before they begin again"
                  : "the setpoints were stopped; let them pause or send 0 before they begin "
                    "again");
        }
        machine.refuseUnlessReadyToMove(moved);
        return is_position ? positionGoal(machine, moved, setpoint.value, timeout)
                           : velocityGoal(machine, moved, setpoint.value, timeout);
      });
}

}  // namespace stepdriver::machine
