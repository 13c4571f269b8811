#include "jog.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <vector>

#include "activity/follow_goal.h"
#include "message_text.h"
#include "streamed_start.h"

namespace stepdriver::machine {

std::string Jog::text(const AxisWords& axes) const {
  return fmt::format("jog {}: {} {}/s", axes.name(axis), numberText(velocity), axes.unit(axis));
}

std::optional<activity::Goal> Jog::goalOf(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& moved = machine.axis(axis);
  moved.refuseUnlessFinite("velocity", velocity, "/s");
  const double wanted = velocityOrRest(moved, velocity);
  const activity::Goal* current = streamedGoal(machine, moved);
  const bool jogs = current != nullptr && current->kind == activity::Goal::Kind::kJog;
  if (wanted == 0.0) {
    const bool waits = !moved.moving();
    for (activity::Activity* at :
         {machine.activities.heir(moved), machine.activities.owner(moved)}) {
      if (at != nullptr && at->isStreamed() && (jogs || waits)) {
        at->end({axis::MoveEnd::kStopped, "the jog ended"}, call);
      }
    }
    return std::nullopt;
  }
  if (moved.stops != unless_stopped_since.value_or(moved.stops)) {
    moved.refuse("the jog was stopped; let it pause or send 0 before it begins again");
  }
  machine.refuseUnlessReadyToMove(moved);
  moved.refuseTooFast(std::abs(wanted));
  activity::Goal goal;
  goal.kind = activity::Goal::Kind::kJog;
  goal.velocity = wanted;
  limitVelocity(goal, moved, "jogs");
  if (jogs && !machine.activities.owner(moved)->motion()->slowsDown() &&
      current->velocity == wanted) {
    return std::nullopt;  // it does that already
  }
  return machine.withOutcome(goal);
}

void Jog::serve(RequestContext& machine, const SharedCall& call) const {
  const std::optional<activity::Goal> goal = goalOf(machine, call);
  if (!goal) return;
  machine.activities.begin(
      std::make_unique<activity::FollowGoal>(
          machine.context, std::vector<activity::Order>{{&machine.axis(axis), *goal}},
          activity::JoinPath(), call),
      kTakenOver);
}

}  // namespace stepdriver::machine
