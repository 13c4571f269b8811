#pragma once

#include <ros/node_handle.h>
#include <stepdriver/MoveLineAction.h>

#include <string>
#include <vector>

#include "action_statuses.h"
#include "motion_action.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// A current goal of ~move_line.
struct FollowingLine {
  actionlib::ServerGoalHandle<MoveLineAction> handle;
  machine::CoordinatedMove move;
  std::vector<double> began_at;  // [unit] of its axes
  std::string preempted_by;      // a cancel, in words; empty: no cancel
};

/// The action ~move_line: the service as an action. A goal is accepted once its line begins; until
/// then its axes come to rest, or wait for the end of a hold, and a cancel stops them.
class LineAction : public MotionAction<MoveLineAction, FollowingLine> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, statuses outlive the action.
  LineAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
             ActionStatuses& statuses);

 private:
  FollowingLine begin(const GoalHandle& handle) override;
  void reject(GoalHandle& handle, const Error& error) override;
  void takeOver(const FollowingLine& /*newer*/, FollowingLine& /*older*/) override {}
  void stop(const FollowingLine& following) override;
  void cancelBeginning(const GoalHandle& handle) override;
  bool conclude(FollowingLine& following) override;
  void watch(FollowingLine& following, bool tell) override;

  machine::Machine& machine_;
  PeriodicPoll poll_;
};

}  // namespace stepdriver::ros_node
