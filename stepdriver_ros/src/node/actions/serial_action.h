#pragma once

#include <ros/node_handle.h>

#include <chrono>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "action_server.h"

namespace stepdriver::ros_node {

/// An action whose goals run one after the other: a newer one cancels the current one, and those
/// that haven't begun. While there are goals it has a thread that runs them.
template <typename Action>
class SerialAction {
 public:
  using GoalHandle = typename ActionServer<Action>::GoalHandle;
  /// Runs a goal to its end and reports that. It calls the second parameter again and again, and
  /// ends early if that returns true: the goal is cancelled.
  using Run = std::function<void(GoalHandle&, const std::function<bool()>&)>;

  /// @param node with the queue of the goals and cancels.
  /// @param topics outlives the action.
  /// @param run must return soon if the action is destroyed.
  SerialAction(const ros::NodeHandle& node, const std::string& name, ActionTopics& topics, Run run)
      : run_(std::move(run)),
        server_(
            node, name, topics, [this](const GoalHandle& goal) { onGoal(goal); },
            [this](const GoalHandle& goal) { cancel(goal); }) {
    server_.start();
  }
  SerialAction(const SerialAction&) = delete;
  SerialAction& operator=(const SerialAction&) = delete;

 private:
  static constexpr const char* kNewerGoal = "a newer goal has come";

  void onGoal(const GoalHandle& goal) {
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
    if (running_) return;
    thread_ = std::async(std::launch::async, [this] { runAll(); });
    running_ = true;
  }

  void cancel(const GoalHandle& goal) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (current_ && *current_ == goal) cancelled_ = true;
    if (!next_ || *next_ != goal) return;
    next_->setCanceled({}, "it was cancelled before it began");
    next_.reset();
  }

  void runAll() {
    while (beginNext()) run_(*current_, [this] { return isCancelled(); });
  }

  /// Begins the next goal. @return whether there is one.
  bool beginNext() {
    const std::lock_guard<std::mutex> lock(mutex_);
    current_ = next_;
    next_.reset();
    cancelled_ = false;
    running_ = current_.has_value();
    if (current_) current_->setAccepted();
    return running_;
  }

  bool isCancelled() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return cancelled_;
  }

  const Run run_;
  ActionServer<Action> server_;
  std::mutex mutex_;
  std::optional<GoalHandle> current_;
  std::optional<GoalHandle> next_;
  bool cancelled_ = false;  // the current one
  bool running_ = false;    // the thread
  std::future<void> thread_;
};

}  // namespace stepdriver::ros_node
