#include "homing_action.h"

#include <exception>

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kFeedbackPeriod{100};
constexpr const char* kNewerGoal = "a newer goal has come";

}  // namespace

HomingAction::HomingAction(const ros::NodeHandle& node, axis::Axis& axis, ActionStatuses& statuses)
    : axis_(axis),
      server_(
          node, "homing", statuses, [this](const GoalHandle& goal) { take(goal); },
          [this](const GoalHandle& goal) { cancel(goal); }) {
  server_.start();
}

void HomingAction::take(const GoalHandle& goal) {
  GoalHandle newer = goal;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& other : {current_, next_}) {
    if (!other || newer.getGoalID().stamp >= other->getGoalID().stamp) continue;
    newer.setCanceled({}, kNewerGoal);
    return;
  }
  if (next_) next_->setCanceled({}, kNewerGoal);
  next_ = newer;
  cancelled_ = true;
  if (homing_) return;
  thread_ = std::async(std::launch::async, [this] { homeForAll(); });
  homing_ = true;
}

void HomingAction::cancel(const GoalHandle& goal) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (current_ && *current_ == goal) cancelled_ = true;
  if (!next_ || *next_ != goal) return;
  next_->setCanceled({}, "it was cancelled before it began");
  next_.reset();
}

void HomingAction::homeForAll() {
  while (beginNext()) home();
}

bool HomingAction::beginNext() {
  const std::lock_guard<std::mutex> lock(mutex_);
  current_ = next_;
  next_.reset();
  cancelled_ = false;
  homing_ = current_.has_value();
  if (current_) current_->setAccepted();
  return homing_;
}

bool HomingAction::isCancelled() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return cancelled_;
}

void HomingAction::home() {
  HomeResult answer;
  axis::HomingEnd end = axis::HomingEnd::kFailed;
  try {
    told_ = axis::HomingPhase::kNone;
    const axis::HomingResult result = axis_.home([this] {
      tell();
      return isCancelled();
    });
    end = result.end;
    answer.message = result.message;
  } catch (const std::exception& error) {
    answer.message = error.what();
  }
  answer.position = axis_.state().position;
  if (end == axis::HomingEnd::kHomed) {
    current_->setSucceeded(answer, answer.message);
  } else if (end == axis::HomingEnd::kCancelled) {
    current_->setCanceled(answer, answer.message);
  } else {
    current_->setAborted(answer, answer.message);
  }
}

void HomingAction::tell() {
  const axis::AxisState state = axis_.state();
  const Clock::time_point now = Clock::now();
  if (state.homing == told_ && now < told_at_ + kFeedbackPeriod) return;
  told_ = state.homing;
  told_at_ = now;
  HomeFeedback feedback;
  feedback.phase = axis::nameOf(state.homing);
  feedback.position = state.position;
  current_->publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
