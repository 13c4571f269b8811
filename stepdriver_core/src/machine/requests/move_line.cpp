#include "move_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include "activity/follow_goal.h"
#include "message_text.h"
#include "target.h"

namespace stepdriver::machine {
namespace {

void refuseBadNumber(const axis::AxisModel& axis, const char* what, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  axis.refuse(
      fmt::format("the {} of the line is {}, but must be a finite number above 0, or 0 for as fast "
                  "as the limits allow",
                  what, numberText(value)));
}

/// For a line whose axes may still have to come to rest, for any direction.
void refuseTooFast(const std::vector<const axis::AxisModel*>& axes, double velocity) {
  double linear = 0.0;
  double rotary = 0.0;
  for (const axis::AxisModel* axis : axes) {
    double& sum = axis->config.kind == config::Kind::kLinear ? linear : rotary;
    sum += axis->maxSpeed() * axis->maxSpeed();
  }
  const double most = std::sqrt(std::max(linear, rotary));
  if (velocity <= most * (1.0 + 1e-12)) return;
  axes.front()->refuse(fmt::format(
      "the velocity {0} {2} of the line is above {1} {2}, the highest that its axes reach together",
      numberText(velocity), upperBoundText(most), linear >= rotary ? "m/s" : "rad/s"));
}

}  // namespace

std::string MoveLine::text(const AxisWords& words) const {
  std::string text = "line";
  for (std::size_t i = 0; i < axes.size(); ++i) {
    text += fmt::format("{} {} {} {} {}", i == 0 ? "" : ",", words.name(axes[i]),
                        relative ? "by" : "to", numberText(positions.at(i)), words.unit(axes[i]));
  }
  if (velocity > 0.0) text += fmt::format(", velocity {}", numberText(velocity));
  if (duration > 0.0) text += fmt::format(", duration {} s", numberText(duration));
  return text;
}

std::shared_ptr<const axis::Outcome<axis::MoveResult>> MoveLine::begin(
    RequestContext& machine, const SharedCall& call) const {
  const axis::AxisModel& first = machine.axis(axes.front());
  refuseBadNumber(first, "velocity", velocity);
  refuseBadNumber(first, "duration", duration);
  if (velocity > 0.0 && duration > 0.0) {
    first.refuse(
        fmt::format("the line has a velocity, {}, and a duration, {} s; give only one of them",
                    numberText(velocity), numberText(duration)));
  }
  std::vector<const axis::AxisModel*> moved_axes;
  for (const AxisId id : axes) moved_axes.push_back(&machine.axis(id));
  refuseTooFast(moved_axes, velocity);
  std::vector<activity::Order> orders;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    axis::AxisModel& moved = machine.axis(axes[i]);
    activity::Goal goal;
    goal.kind = activity::Goal::Kind::kTogether;
    if (continues) {
      setPlace(goal, machine, moved, positions[i]);
    } else {
      setTarget(goal, machine, moved, positions[i], relative);
    }
    orders.push_back({&moved, machine.withOutcome(goal)});
  }
  const auto outcome = orders.front().goal.outcome;
  machine.activities.begin(std::make_unique<activity::FollowLine>(
                               machine.context, std::move(orders), velocity, duration, call),
                           {axis::MoveEnd::kStopped, "a line was to begin"});
  return outcome;
}

}  // namespace stepdriver::machine
