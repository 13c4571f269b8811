#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "context.h"
#include "goal.h"
#include "point_to_point/planner.h"
#include "profile/shaped_profile.h"

namespace stepdriver::activity {

/// How far beyond the port's horizon a profile begins at first: time to plan it and to hand it
/// over.
constexpr pulse::Nanoseconds kLead = 1'000'000;

/// The plan for a goal of one axis, and the limits that it keeps, see motor::Motion.
struct GoalPlan {
  motion::Plan plan;
  motion::MotionLimits limits;
  std::int64_t slows_ns = motor::Motion::kNeverSlows;
};

/// The plan for a goal of one axis, from the state of the axis at a motion time.
///
/// If the limits have changed since the motion under way was planned, the new ones apply, unless
/// the axis would pass its target or a soft limit farther with them: then it keeps the old ones. If
/// it would still pass a soft limit, it has those of stops.
///
/// @throw motion::TooLong if the motion takes too long; Refused if the timeout of a setpoint is
///   over before the axis moves.
/// @param now motion time at which its overshoot begins to count: until the plan begins, the axis
///   continues its motion.
GoalPlan planGoal(const axis::AxisModel& axis, const Goal& goal, std::int64_t now, std::int64_t at);

/// The count at which the motor has to stop for a goal of the joint: a backlash is taken up or open
/// there.
///
/// @param slack [microsteps] the part of the backlash that is taken up in the state `from`.
/// @param within the limits of the motion from this state.
std::int64_t motorTarget(const axis::AxisModel& axis, const Goal& goal,
                         const motion::MotionState& from, double slack,
                         const motion::MotionLimits& within);

/// The count at which the motor has to stop for the joint to rest on a soft limit, at the upper or
/// at the lower end, from a state within limits.
std::int64_t limitTarget(const axis::AxisModel& axis, std::int64_t limit, bool up,
                         const motion::MotionState& from, const motion::MotionLimits& within);

/// The count of limitTarget() for the soft limit in the direction in which the axis moves; empty:
/// there is none.
std::optional<std::int64_t> limitAhead(const axis::AxisModel& axis, const motion::MotionState& from,
                                       const motion::MotionLimits& within);

/// The count at which the motor has to stop a goal that runs(), from a state within limits; empty
/// without a limit.
std::optional<std::int64_t> standAt(const axis::AxisModel& axis, const Goal& goal,
                                    const motion::MotionState& from,
                                    const motion::MotionLimits& within);

/// The fastest stop within the limits of stops. @pre the axis moves.
motion::Profile planStop(const axis::AxisModel& axis, std::int64_t at);

/// The first motion time at which a new profile of an axis may begin.
///
/// @param lead the time to plan it and to hand it over.
std::int64_t earliestStart(const Context& context, const axis::AxisModel& axis,
                           pulse::Nanoseconds lead);

/// The steps of a goal; of a jog only their sign.
std::int64_t stepsTo(const axis::AxisModel& axis, const Goal& goal);

/// The answer for a caller about a planned goal, without an outcome.
///
/// @param overshoot [microsteps]
/// @param together the goals of all axes that begin with it, which may share motors.
axis::Move moveOf(const axis::AxisModel& axis, const Goal& goal,
                  const motion::ShapedProfile& motion, double overshoot,
                  const std::vector<Order>& together = {});

}  // namespace stepdriver::activity
