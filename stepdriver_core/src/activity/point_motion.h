#pragma once

#include <cstdint>

#include "context.h"
#include "goal.h"
#include "motion/planner.h"

namespace stepdriver::activity {

/// How far ahead of now a profile begins at first: time to plan it and to hand it over.
constexpr pulse::Nanoseconds kLead = 1'000'000;

/// The plan for a goal of one axis, from whatever the axis will do at a motion time.
///
/// @throw std::range_error if the motion takes too long.
motion::Plan planGoal(const axis::AxisModel& axis, const Goal& goal, std::int64_t at);

/// The fastest way to rest that every stop keeps to. @pre the axis moves.
motion::Profile planStop(const axis::AxisModel& axis, std::int64_t at);

/// The first motion time at which a new profile of an axis may begin.
std::int64_t earliestStart(const Context& context, const axis::AxisModel& axis,
                           pulse::Nanoseconds lead);

/// The steps that a goal asks for; of a jog just their sign.
std::int64_t stepsTo(const axis::AxisModel& axis, const Goal& goal);

/// What a caller is told of a plan for a goal; without an outcome. @param overshoot [microsteps]
axis::Move moveOf(const axis::AxisModel& axis, const Goal& goal, const motion::Profile& profile,
                  double overshoot);

}  // namespace stepdriver::activity
