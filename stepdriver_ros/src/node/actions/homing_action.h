#pragma once

#include <ros/node_handle.h>
#include <stepdriver/HomeAction.h>

#include <chrono>
#include <future>
#include <mutex>
#include <optional>
#include <string>

#include "action_server.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// The action `homing` of one axis, below its name. Its goals run one after the other: a newer one
/// cancels the current one, and those that haven't begun. While there are goals it has a thread
/// that waits for them.
class HomingAction {
 public:
  /// @param node a handle below the axis's name, with the queue of the goals and cancels.
  /// @param axis, statuses outlive the action; before its end the machine has been shut down.
  HomingAction(const ros::NodeHandle& node, axis::Axis& axis, ActionStatuses& statuses);
  HomingAction(const HomingAction&) = delete;
  HomingAction& operator=(const HomingAction&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  using Server = ActionServer<HomeAction>;
  using GoalHandle = Server::GoalHandle;

  void take(const GoalHandle& goal);
  void cancel(const GoalHandle& goal);
  void homeForAll();
  /// Begins the next goal. @return whether there is one.
  bool beginNext();
  bool isCancelled();
  void home();
  void tell();

  axis::Axis& axis_;
  Server server_;
  // For the thread only.
  axis::HomingPhase told_ = axis::HomingPhase::kNone;
  Clock::time_point told_at_;

  std::mutex mutex_;
  std::optional<GoalHandle> current_;
  std::optional<GoalHandle> next_;
  bool cancelled_ = false;  // the current one
  bool homing_ = false;     // the thread runs
  std::future<void> thread_;
};

}  // namespace stepdriver::ros_node
