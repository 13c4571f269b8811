#include "homing_action.h"

#include <algorithm>
#include <exception>

#include "node/homing_results.h"
#include "node/refusal_log.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kFeedbackPeriod{100};

}  // namespace

bool HomingReports::due(const std::vector<axis::HomingPhase>& phases) {
  const Clock::time_point now = Clock::now();
  if (phases == told_ && now < told_at_ + kFeedbackPeriod) return false;
  told_ = phases;
  told_at_ = now;
  return true;
}

// ---- one axis ----

HomingAction::HomingAction(const ros::NodeHandle& node, axis::Axis& axis, ActionTopics& topics)
    : axis_(axis), goals_(node, "homing", topics, [this](auto& goal, const auto& cancelled) {
        home(goal, cancelled);
      }) {}

HomingAction::~HomingAction() = default;

void HomingAction::home(Goals::GoalHandle& goal, const std::function<bool()>& cancelled) {
  HomingReports reports;
  HomeResult answer;
  axis::HomingEnd end = axis::HomingEnd::kFailed;
  try {
    const axis::HomingResult result = axis_.home([&] {
      const axis::AxisState state = axis_.state();
      if (reports.due({state.homing})) {
        HomeFeedback feedback;
        feedback.phase = axis::nameOf(state.homing);
        feedback.position = state.position;
        goal.publishFeedback(feedback);
      }
      return cancelled();
    });
    end = result.end;
    answer.message = result.message;
  } catch (const std::exception& error) {
    answer.message = error.what();
    logRefusal(answer.message);
  }
  answer.position = axis_.state().position;
  if (end == axis::HomingEnd::kHomed) {
    goal.setSucceeded(answer, answer.message);
  } else if (end == axis::HomingEnd::kCancelled) {
    goal.setCanceled(answer, answer.message);
  } else {
    goal.setAborted(answer, answer.message);
  }
}

// ---- all axes ----

MachineHomingAction::MachineHomingAction(const ros::NodeHandle& node, machine::Machine& machine,
                                         ActionTopics& topics)
    : machine_(machine), goals_(node, "homing", topics, [this](auto& goal, const auto& cancelled) {
        home(goal, cancelled);
      }) {}

MachineHomingAction::~MachineHomingAction() = default;

void MachineHomingAction::home(Goals::GoalHandle& goal, const std::function<bool()>& cancelled) {
  HomingReports reports;
  HomeAxesResult answer;
  std::vector<axis::HomingResult> results;
  try {
    results = machine_.home(goal.getGoal()->name, [&] {
      report(goal, reports);
      return cancelled();
    });
    answer.message = messageOf(results);
  } catch (const std::exception& error) {
    answer.message = error.what();
    logRefusal(answer.message);
  }
  for (const axis::HomingResult& result : results) {
    answer.name.push_back(result.axis);
    answer.homed.push_back(result.end == axis::HomingEnd::kHomed);
    answer.position.push_back(result.position);
  }
  if (!results.empty() && areAllHomed(results)) {
    goal.setSucceeded(answer, answer.message);
  } else if (std::any_of(results.begin(), results.end(), [](const axis::HomingResult& result) {
               return result.end == axis::HomingEnd::kCancelled;
             })) {
    goal.setCanceled(answer, answer.message);
  } else {
    goal.setAborted(answer, answer.message);
  }
}

void MachineHomingAction::report(Goals::GoalHandle& goal, HomingReports& reports) const {
  HomeAxesFeedback feedback;
  std::vector<axis::HomingPhase> phases;
  for (const auto& axis : machine_.axes()) {
    const axis::AxisState state = axis->state();
    phases.push_back(state.homing);
    if (state.homing == axis::HomingPhase::kNone) continue;
    feedback.name.push_back(axis->config().name);
    feedback.phase.emplace_back(axis::nameOf(state.homing));
    feedback.position.push_back(state.position);
  }
  if (reports.due(phases)) goal.publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
