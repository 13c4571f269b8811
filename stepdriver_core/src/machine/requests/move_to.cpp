#include "move_to.h"

#include <fmt/format.h>

#include <memory>
#include <vector>

#include "activity/follow_goal.h"
#include "message_text.h"
#include "target.h"

namespace stepdriver::machine {

std::string MoveTo::text(const AxisWords& axes) const { return "move " + goalText(axes); }

std::string MoveTo::goalText(const AxisWords& axes) const {
  return fmt::format("{} {} {} {}{}", axes.name(axis), relative ? "by" : "to", numberText(position),
                     axes.unit(axis), axes.velocity(axis, velocity));
}

activity::Goal MoveTo::goalOf(RequestContext& machine) const {
  axis::AxisModel& moved = machine.axis(axis);
  activity::Goal goal;
  double place = position;
  if (shortest) {
    if (relative) moved.refuse("shortest: the position is relative, but must be absolute");
    if (!moved.config.continuous) {
      moved.refuse("shortest: the axis doesn't turn without end, see continuous in its parameters");
    }
    place += moved.pathAxis().turnsTowards(moved.positionOf(moved.jointCount()), place);
  }
  setTarget(goal, machine, moved, place, relative);
  goal.velocity = moved.checkedVelocity(velocity);
  if (!moved.moving()) moved.refuseIntoEndstop(*goal.target - moved.jointCount());
  return goal;
}

void MoveTo::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& moved = machine.axis(axis);
  const activity::Goal goal = machine.withOutcome(goalOf(machine));
  machine.activities.begin(std::make_unique<activity::FollowGoal>(
                               machine.context, std::vector<activity::Order>{{&moved, goal}},
                               activity::JoinPath(), call),
                           kTakenOver);
}

}  // namespace stepdriver::machine
