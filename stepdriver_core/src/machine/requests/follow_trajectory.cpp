#include "follow_trajectory.h"

#include <cstddef>
#include <utility>

#include "activity/follow_goal.h"
#include "profile/resting_count.h"

namespace stepdriver::machine {
namespace {

constexpr const char* kMovedMeanwhile = "it moved while its path was planned";

// @return why the preparation doesn't fit the axes any more; empty if it does.
std::string whyOutdated(const FollowTrajectory& wanted, const std::vector<axis::AxisModel*>& axes) {
  if (!wanted.prepared) return axes.front()->name() + ": not prepared";
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i]->pathAxis() != wanted.prepared->axes()[i]) {
      return axes[i]->name() + ": its limits or its scale changed meanwhile";
    }
    if (wanted.path &&
        (axes[i]->moving() || restOf(axes[i]->pathStart(0)) != wanted.path->from[i])) {
      return axes[i]->name() + ": " + kMovedMeanwhile;
    }
  }
  return {};
}

}  // namespace

std::string FollowTrajectory::text(const AxisWords& words) const {
  const std::string what = "trajectory of " + words.names(axes);
  return begins_ns > 0 ? what + ", later" : what;
}

void FollowTrajectory::serve(RequestContext& machine, const SharedCall& call) const {
  std::vector<axis::AxisModel*> moved_axes;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    axis::AxisModel& moved = machine.axis(axes[i]);
    machine.refuseUnlessReadyToMove(moved);
    moved.refuseUnlessHomed();
    if (moved.stops != stops[i]) moved.refuse("it was stopped while this was prepared");
    if (!prepared) activity::refuseIfStopped(machine.context, moved);
    moved_axes.push_back(&moved);
  }
  const std::string outdated = whyOutdated(*this, moved_axes);
  if (!outdated.empty()) return call->fail({activity::Failure::Kind::kOutdated, outdated});
  std::vector<activity::Order> orders;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    activity::Goal goal;
    goal.kind = activity::Goal::Kind::kTogether;
    const double target = path ? path->targets[i] : prepared->target(i);
    goal.target = motion::restingCount(target);
    goal.remainder = target - static_cast<double>(*goal.target);
    goal.path_limits = prepared->axes()[i].limits;
    orders.push_back({moved_axes[i], machine.withOutcome(goal)});
  }
  const auto join = [prepared = prepared, moved_axes,
                     path = path](const std::vector<motion::PathStart>& starts) {
    for (std::size_t i = 0; path && i < starts.size(); ++i) {
      if (starts[i].moves || restOf(starts[i]) != path->from[i]) {
        moved_axes[i]->refuse(kMovedMeanwhile);
      }
    }
    auto joined = motion::PreparedTrajectory::join(prepared, starts);
    if (!path || !path->window) return joined;
    return std::shared_ptr<const motion::SharedPath>(
        std::make_shared<const motion::QueuedPath>(std::move(joined), path->window, true));
  };
  if (begins_ns > 0) {
    std::vector<motion::PathAxis> facts = prepared->axes();
    return call->succeed(
        machine.activities.beginLater({std::move(orders), join, std::move(facts), begins_ns}));
  }
  const auto join_at = [join, moved_axes](std::int64_t at) {
    return join(activity::startsOf(moved_axes, at));
  };
  machine.activities.begin(
      std::make_unique<activity::FollowGoal>(machine.context, std::move(orders), join_at, call),
      kTakenOver);
}

}  // namespace stepdriver::machine
