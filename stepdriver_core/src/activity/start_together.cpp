#include "start_together.h"

#include <algorithm>
#include <utility>

namespace stepdriver::activity {
namespace {

std::vector<axis::AxisModel*> axesOfStarts(const std::vector<StartTogether::Start>& starts) {
  std::vector<axis::AxisModel*> axes;
  axes.reserve(starts.size());
  for (const StartTogether::Start& start : starts) axes.push_back(start.order.axis);
  return axes;
}

Activity::Handover handoverOfStarts(const std::vector<StartTogether::Start>& starts) {
  const bool wakes = std::any_of(starts.begin(), starts.end(),
                                 [](const auto& start) { return start.order.axis->mustWake(); });
  return wakes ? Activity::Handover::kAfterRest : Activity::Handover::kAtSpeed;
}

/// Passes a failure on to all calls.
class Passing : public AnswerSink {
 public:
  explicit Passing(std::vector<SharedCall> calls) : calls_(std::move(calls)) {}
  void answer(CallId /*call*/, Reply reply) override {
    for (const SharedCall& call : calls_) {
      if (reply.failure) call->fail(*reply.failure);
    }
    calls_.clear();
  }

 private:
  std::vector<SharedCall> calls_;
};

SharedCall callOfAll(const std::vector<StartTogether::Start>& starts) {
  struct All {
    explicit All(std::vector<SharedCall> calls) : passing(std::move(calls)), call(passing, 0) {}
    Passing passing;
    PendingCall call;  // ends first
  };
  std::vector<SharedCall> calls;
  calls.reserve(starts.size());
  for (const StartTogether::Start& start : starts) calls.push_back(start.call);
  const auto all = std::make_shared<All>(std::move(calls));
  return {all, &all->call};
}

}  // namespace

StartTogether::StartTogether(Context& context, std::vector<Start> starts)
    : Script(context, axesOfStarts(starts), handoverOfStarts(starts), callOfAll(starts)),
      starts_(std::move(starts)) {}

void StartTogether::prepare() {
  auto start = std::make_shared<CommonStart>();
  start->number = context().newStart();
  start->axes.assign(axes().begin(), axes().end());
  goals_.clear();
  for (const Start& each : starts_) {
    goals_.push_back(std::make_unique<FollowGoal>(context(), std::vector<Order>{each.order},
                                                  JoinPath(), each.call, start));
    goals_.back()->prepare();
  }
}

Steps StartTogether::plan() {
  Steps steps;
  for (axis::AxisModel* axis : axes()) {
    axis->refuseWhileHeld();
    axis->refuseUnlessReady();
    append(steps, wakeSteps(context(), *axis));
  }
  add(steps, std::make_unique<RunStep>([this] {
        if (goals_.empty()) prepare();
        takeCall();
        may_begin_ = true;
      }));
  return steps;
}

std::vector<Activity::Part> StartTogether::takeParts() {
  std::vector<Part> parts;
  if (!std::exchange(may_begin_, false)) return parts;
  std::vector<Predecessor> left = takePredecessors();
  for (auto& goal : goals_) {
    Part& part = parts.emplace_back();
    for (Predecessor& before : left) {
      if (before.axis == goal->axes().front()) part.predecessors.push_back(std::move(before));
    }
    part.activity = std::move(goal);
  }
  starts_.clear();
  goals_.clear();
  return parts;
}

}  // namespace stepdriver::activity
