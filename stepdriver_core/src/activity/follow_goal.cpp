#include "follow_goal.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::activity {

std::vector<axis::AxisModel*> axesOf(const std::vector<Order>& orders) {
  std::vector<axis::AxisModel*> axes;
  axes.reserve(orders.size());
  for (const Order& order : orders) axes.push_back(order.axis);
  return axes;
}

std::vector<motion::PathStart> startsOf(const std::vector<axis::AxisModel*>& axes,
                                        std::int64_t at) {
  std::vector<motion::PathStart> starts;
  starts.reserve(axes.size());
  for (const axis::AxisModel* axis : axes) starts.push_back(axis->pathStart(at));
  return starts;
}

// ---- from any state of the axes ----

namespace {

// While pins are written, nothing could slow down the others: they come to rest before that.
Activity::Handover handoverOf(const std::vector<Order>& orders) {
  const bool wakes = std::any_of(orders.begin(), orders.end(),
                                 [](const Order& order) { return order.axis->mustWake(); });
  return wakes ? Activity::Handover::kAfterRest : Activity::Handover::kAtSpeed;
}

}  // namespace

FollowGoal::FollowGoal(Context& context, std::vector<Order> orders, JoinPath join, SharedCall call,
                       std::shared_ptr<const CommonStart> start, std::int64_t begins_ns)
    : Script(context, axesOf(orders), handoverOf(orders), std::move(call)),
      orders_(std::move(orders)),
      join_(std::move(join)),
      start_(std::move(start)),
      begins_ns_(begins_ns) {}

std::unique_ptr<FollowStep> FollowGoal::follow() {
  return std::make_unique<FollowStep>(
      context(), orders_, join_, [this] { return takePredecessors(); },
      [this] { return takeCall(); }, start_, begins_ns_);
}

void FollowGoal::prepare() {
  prepared_ = follow();
  prepared_->prepare();
}

// Nobody may want it anymore when the hold ends.
void FollowGoal::hold(const SharedCall& call) {
  if (motion() == nullptr && isStreamed()) return end(kEndedByHold, call);
  Script::hold(call);
}

Steps FollowGoal::plan() {
  Steps steps;
  if (isStreamed()) orders_.front().axis->refuseWhileHeld();
  for (const Order& order : orders_) {
    order.axis->refuseUnlessReady();  // as an heir it begins later than it was accepted
    append(steps, wakeSteps(context(), *order.axis));
  }
  steps.push_back(prepared_ ? std::move(prepared_) : follow());
  return steps;
}

// ---- a line ----

FollowLine::FollowLine(Context& context, std::vector<Order> orders, double velocity,
                       double duration, SharedCall call)
    : Script(context, axesOf(orders), Handover::kAfterRest, std::move(call)),
      orders_(std::move(orders)),
      velocity_(velocity),
      duration_(duration) {}

Failure FollowLine::notDone(const std::string& why) const {
  return Script::notDone("the line did not begin: " + why);
}

void FollowLine::check() const {
  for (const Order& order : orders_) {
    if (order.axis->fault) throw Refused(notDone(order.axis->fault.what()).text);
    order.axis->refuseUnlessReady();
    order.axis->refuseIntoEndstop(*order.goal.target - order.axis->jointCount());
  }
}

const std::shared_ptr<const motion::LinePath>& FollowLine::linePath() {
  std::vector<double> targets;
  std::vector<motion::PathAxis> facts;
  for (const Order& order : orders_) {
    targets.push_back(order.goal.end(*order.axis));
    facts.push_back(order.axis->pathAxis());
  }
  const std::vector<motion::PathStart> starts = startsOf(axes(), 0);
  if (!path_ || !path_->isOf(facts, starts)) {
    path_ = std::make_shared<const motion::LinePath>(std::move(facts), starts, targets, velocity_,
                                                     duration_);
  }
  return path_;
}

Steps FollowLine::plan() {
  check();
  linePath();  // a refusal must come before the backlash is taken up
  Steps steps;
  for (const Order& order : orders_) {
    append(steps, wakeSteps(context(), *order.axis));
  }
  for (const Order& order : orders_) {
    add(steps, std::make_unique<RunStep>([this, &order] { insert(takeUp(order)); }));
  }
  add(steps, std::make_unique<RunStep>([this] { insert(followLine()); }));
  return steps;
}

// Brings the motor to the position from which the joint moves with the first step of the line.
Steps FollowLine::takeUp(const Order& order) {
  axis::AxisModel& axis = *order.axis;
  const std::int64_t way = *order.goal.target - axis.jointCount();
  const std::int64_t wanted = way > 0 ? axis.backlash() : 0;
  Steps steps;
  if (way == 0 || axis.motor.state().slack == wanted) return steps;
  Goal goal;
  goal.target = axis.jointCount() + wanted;
  goal.velocity = axis.maxSpeed();
  goal.of_motor = true;
  goal.outcome = std::make_shared<axis::Outcome<axis::MoveResult>>();
  const auto nobody = [] { return std::vector<Predecessor>(); };
  add(steps, std::make_unique<FollowStep>(context(), std::vector<Order>{{&axis, goal}}, JoinPath(),
                                          nobody, [] { return SharedCall(); }));
  add(steps, std::make_unique<RunStep>([this, &axis, goal] {
        check();
        const auto result = goal.outcome->get();
        if (result && result->end != axis::MoveEnd::kReached) {
          throw Refused(
              fmt::format("{}: the line did not begin: {}", axis.name(), result->message));
        }
      }));
  return steps;
}

Steps FollowLine::followLine() {
  check();
  const auto join =
      [this, path = linePath()](std::int64_t at) -> std::shared_ptr<const motion::SharedPath> {
    path->requireStart(startsOf(axes(), at));
    return {path};
  };
  std::vector<Order> orders = orders_;
  for (Order& order : orders) order.goal.path_limits = order.axis->pathAxis().limits;
  Steps steps;
  add(steps, std::make_unique<FollowStep>(
                 context(), std::move(orders), join, [] { return std::vector<Predecessor>(); },
                 [this] { return takeCall(); }));
  return steps;
}

}  // namespace stepdriver::activity
