#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "activity/goal.h"
#include "activity/start_together.h"
#include "request_context.h"
#include "stepdriver_core/error.h"

/// @file What the requests have in common that clients send in streams: jogs and setpoints.

namespace stepdriver::machine {

/// A velocity of a stream; 0 if it is lower than any that can be configured: it would make no step
/// in a quarter of an hour, and might take longer to a soft limit than a motion can.
double velocityOrRest(const axis::AxisModel& axis, double velocity);

/// The goal of the axis's present motion if that is streamed; nullptr if not.
const activity::Goal* streamedGoal(const RequestContext& machine, const axis::AxisModel& axis);

/// Sets the soft limit ahead as the end of a velocity. @throw Refused if it can't begin.
void limitVelocity(activity::Goal& goal, const axis::AxisModel& axis, const char* moves);

/// Starts axes at the same motion time. Those that move need not wait for others that are at rest
/// and must be woken first.
void beginTogether(const RequestContext& machine,
                   std::vector<activity::StartTogether::Start> starts);

/// Starts what each message asks for. A refusal concerns only its own axis.
/// @param goal_of of a message and its part of the call: its goal, if something new must begin.
template <typename Message, typename GoalOf>
void beginStreamed(const RequestContext& machine, const std::vector<Message>& messages,
                   const SharedCall& call, const GoalOf& goal_of) {
  const std::vector<SharedCall> calls = activity::PartedCall::divide(call, messages.size());
  std::vector<activity::StartTogether::Start> starts;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    try {
      const std::optional<activity::Goal> goal = goal_of(messages[i], calls[i]);
      if (goal) starts.push_back({{&machine.axis(messages[i].axis), *goal}, calls[i]});
    } catch (const Error& error) {
      calls[i]->fail(activity::failureOf(error));
    }
  }
  beginTogether(machine, std::move(starts));
}

}  // namespace stepdriver::machine
