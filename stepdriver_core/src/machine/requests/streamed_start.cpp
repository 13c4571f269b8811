#include "streamed_start.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "profile/resting_count.h"

namespace stepdriver::machine {

double velocityOrRest(const axis::AxisModel& axis, double velocity) {
  return std::abs(velocity) * axis.stepsPerUnit() < config::kLowestRate ? 0.0 : velocity;
}

const activity::Goal* streamedGoal(const RequestContext& machine, const axis::AxisModel& axis) {
  const activity::Goal* current = axis.moving() ? machine.goalOf(axis) : nullptr;
  return current != nullptr && current->isStreamed() ? current : nullptr;
}

void limitVelocity(activity::Goal& goal, const axis::AxisModel& axis, const char* moves) {
  const bool up = goal.velocity > 0.0;
  const auto& limit = up ? axis.config.max_position : axis.config.min_position;
  if (limit) {
    const double count = axis.countOf(*limit);
    goal.target = motion::restingCount(count);
    // An axis that shares motors has no counts of its own to rest on.
    if (!axis.sharers().empty()) goal.remainder = count - static_cast<double>(*goal.target);
  }
  if (axis.moving()) return;
  const std::int64_t sign = up ? 1 : -1;
  if (goal.target && (*goal.target - axis.jointCount()) * sign <= 0) {
    axis.refuse(fmt::format("it stands at the soft limit {}; it {} only away from it",
                            axis.pathAxis().showLimit(*limit, up ? axis.config.max_position_source
                                                                 : axis.config.min_position_source),
                            moves));
  }
  axis.refuseIntoEndstop(sign);
}

void beginTogether(const RequestContext& machine,
                   std::vector<activity::StartTogether::Start> starts) {
  using Start = activity::StartTogether::Start;
  const auto moves = [&machine](const Start& start) {
    const activity::Activity* owner = machine.activities.owner(*start.order.axis);
    return start.order.axis->moving() && owner != nullptr && owner->canHandOver();
  };
  const bool any_waits = std::any_of(starts.begin(), starts.end(), [&machine](const Start& start) {
    const activity::Activity* owner = machine.activities.owner(*start.order.axis);
    return start.order.axis->mustWake() || (owner != nullptr && !owner->canHandOver());
  });
  const auto first_waiting =
      any_waits ? std::stable_partition(starts.begin(), starts.end(), moves) : starts.end();
  const auto begin = [&machine](std::vector<Start> group) {
    if (group.empty()) return;
    std::vector<SharedCall> calls;
    calls.reserve(group.size());
    for (const Start& start : group) calls.push_back(start.call);
    try {
      machine.activities.begin(
          std::make_unique<activity::StartTogether>(machine.context, std::move(group)), kTakenOver);
    } catch (const Error& error) {
      for (const SharedCall& call : calls) call->fail(activity::failureOf(error));
    }
  };
  begin({starts.begin(), first_waiting});
  begin({first_waiting, starts.end()});
}

}  // namespace stepdriver::machine
