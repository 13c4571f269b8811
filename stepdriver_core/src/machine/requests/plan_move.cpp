#include "plan_move.h"

#include <utility>

#include "activity/follow_goal.h"
#include "activity/point_motion.h"
#include "profile/errors.h"

namespace stepdriver::machine {

std::string PlanMove::text(const AxisWords& axes) const { return "plan " + move.goalText(axes); }

void PlanMove::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& moved = machine.axis(move.axis);
  const activity::Goal goal = move.goalOf(machine);
  axis::MovePlan shown;
  const motion::PlannedMotion planned = [&] {
    try {
      motion::Plan plan = activity::planGoal(moved, goal, machine.context.motionNow(),
                                             activity::earliestStart(machine.context, moved, 0))
                              .plan;
      motion::PlannedMotion motion = moved.motor.shaped(std::move(plan.profile));
      shown.move = activity::moveOf(moved, goal, motion.made(), plan.overshoot);
      return motion;
    } catch (const motion::TooLong& error) {
      moved.refuse(error.what());
    }
  }();
  shown.steps_per_unit = moved.stepsPerUnit();
  const double unit = 1.0 / moved.stepsPerUnit();
  for (const motion::Piece& piece : planned.plan()->pieces()) {
    shown.pieces.push_back({piece.duration.value(), moved.positionOf(piece.p0.value()),
                            piece.v0 * unit, piece.a * unit, piece.j * unit});
  }
  if (const motion::InputShaper* shaper = planned.made().shaper()) {
    for (const motion::Impulse& impulse : shaper->impulses()) {
      shown.parts.push_back({impulse.part, static_cast<double>(impulse.delay_ns) * 1e-9});
    }
  }
  call->succeed(std::move(shown));
}

}  // namespace stepdriver::machine
