#pragma once

#include <actionlib_msgs/GoalStatus.h>
#include <ros/console.h>
#include <ros/duration.h>
#include <ros/node_handle.h>

#include <functional>
#include <iterator>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "action_server.h"
#include "node/refusal_log.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// How often an action polls its goals, while it has any.
inline const ros::WallDuration kPollPeriod(0.01);

/// An action whose goals are motions. It polls them each kPollPeriod: no thread waits for a motion,
/// and it makes no difference which command ends it.
///
/// @tparam Action the type of the action.
/// @tparam Following a current goal; has `GoalHandle handle` and `std::string preempted_by`, a
///   cancel or a newer goal in words.
template <typename Action, typename Following>
class MotionAction {
 public:
  MotionAction(const MotionAction&) = delete;
  MotionAction& operator=(const MotionAction&) = delete;
  virtual ~MotionAction() = default;

  /// Reports results to the clients. Call it each kPollPeriod as soon as a goal has begun.
  ///
  /// @return whether there may be current goals.
  bool poll() {
    const std::lock_guard<std::mutex> lock(mutex_);
    concludeEnded();
    polls_ = (polls_ + 1) % kPollsPerFeedback;
    for (Following& following : under_way_) watch(following, polls_ == 0);
    return !under_way_.empty();
  }

  /// Reports ended goals to their clients; after the machine has been shut down, these are all
  /// goals.
  void reportEnded() {
    const std::lock_guard<std::mutex> lock(mutex_);
    concludeEnded();
  }

 protected:
  using Server = ActionServer<Action>;
  using GoalHandle = typename Server::GoalHandle;

  /// @param node with the queue of the goals and cancels.
  /// @param begun is called when a goal has begun.
  MotionAction(const ros::NodeHandle& node, const std::string& name, ActionTopics& topics,
               std::function<void()> begun)
      : name_(node.resolveName(name)),
        begun_(std::move(begun)),
        server_(
            node, name, topics, [this](const GoalHandle& handle) { onGoal(handle); },
            [this](const GoalHandle& handle) { cancel(handle); }) {}

  /// Call it when the action is fully constructed.
  void start() { server_.start(); }

  /// Calls stop(). If it fails, the log says why, and the goal stays current until its motion ends.
  void stopMotion(const Following& following) {
    logFailure([&] { stop(following); });
  }

 private:
  static constexpr int kPollsPerFeedback = 5;

  /// Begins its motion. @throw Error if it is refused.
  virtual Following begin(const GoalHandle& handle) = 0;
  virtual void reject(GoalHandle& handle, const Error& error) = 0;
  /// A newer goal has begun.
  virtual void takeOver(const Following& newer, Following& older) = 0;
  /// Decelerates the axes that still follow this goal. @throw Error
  virtual void stop(const Following& following) = 0;
  /// Reports the end of the motion to the client. @return whether it has ended.
  virtual bool conclude(Following& following) = 0;
  /// Checks a current motion, and reports on it.
  virtual void watch(Following& following, bool tell) = 0;

  /// A cancel of the goal that begin() is about to begin. Its motion is stopped when it has begun.
  /// @throw Error
  virtual void cancelBeginning(const GoalHandle& /*handle*/) {}

  // Goals come one after another. One may wait for a chip to wake up or for axes to come to rest,
  // or take long to plan: cancels and the other goals don't wait for that.
  void onGoal(GoalHandle handle) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (isCancelled(handle)) {
        handle.setCanceled({}, kCancelledBefore);
        return;
      }
      beginning_ = handle;
    }
    try {
      Following following = begin(handle);
      const std::lock_guard<std::mutex> lock(mutex_);
      beginning_.reset();
      const bool cancelled = isCancelled(handle);
      handle.setAccepted();
      for (Following& older : under_way_) takeOver(following, older);
      under_way_.push_back(std::move(following));
      if (cancelled) cancel(under_way_.back());
      concludeEnded();
      begun_();
    } catch (const Error& error) {
      const std::lock_guard<std::mutex> lock(mutex_);
      beginning_.reset();
      if (isCancelled(handle)) {
        handle.setCanceled({}, kCancelledBefore);
      } else {
        reject(handle, error);
        logRefusal(error.what());
      }
      concludeEnded();
    }
  }

  static bool isCancelled(const GoalHandle& handle) {
    return handle.getGoalStatus().status == actionlib_msgs::GoalStatus::RECALLING;
  }

  void cancel(const GoalHandle& handle) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (beginning_ && *beginning_ == handle) logFailure([&] { cancelBeginning(handle); });
    for (Following& following : under_way_) {
      if (following.handle == handle) cancel(following);
    }
  }

  void cancel(Following& following) {
    following.preempted_by = "it was cancelled";
    stopMotion(following);
  }

  template <typename Stop>
  void logFailure(const Stop& stop) {
    try {
      stop();
    } catch (const Error& error) {
      ROS_ERROR_NAMED("move", "%s can't be stopped: %s", name_.c_str(), error.what());
    }
  }

  // While a goal begins, nothing is concluded: it may be what ended an older one.
  void concludeEnded() {
    if (beginning_) return;
    for (auto following = under_way_.begin(); following != under_way_.end();) {
      following = conclude(*following) ? under_way_.erase(following) : std::next(following);
    }
  }

  static constexpr const char* kCancelledBefore = "it was cancelled before it began";

  const std::string name_;
  const std::function<void()> begun_;
  std::mutex mutex_;
  Server server_;
  std::list<Following> under_way_;
  std::optional<GoalHandle> beginning_;
  int polls_ = 0;
};

}  // namespace stepdriver::ros_node
