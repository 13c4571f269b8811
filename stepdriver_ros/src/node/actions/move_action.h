#pragma once

#include <ros/node_handle.h>
#include <stepdriver/MoveAction.h>

#include <functional>
#include <string>

#include "action_topics.h"
#include "motion_action.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// A current goal of an axis's action `move`.
struct FollowingMove {
  actionlib::ServerGoalHandle<MoveAction> handle;
  axis::Move move;
  double began_at = 0.0;     // [unit]
  std::string preempted_by;  // a cancel, in words; empty: no cancel
};

/// The action `move` of one axis, below its name: the service `move_to` as an action. It is
/// independent of other commands to the axis and of other waiting clients.
class AxisMoveAction : public MotionAction<MoveAction, FollowingMove> {
 public:
  /// @param node a handle below the axis's name, with the queue of the goals and cancels.
  /// @param axis, topics outlive the action.
  /// @param begun is called when a goal has begun: from then on poll() must be called.
  AxisMoveAction(const ros::NodeHandle& node, axis::Axis& axis, ActionTopics& topics,
                 std::function<void()> begun);
  ~AxisMoveAction() override;

 private:
  FollowingMove begin(const GoalHandle& handle) override;
  void reject(GoalHandle& handle, const Error& error) override;
  void takeOver(const FollowingMove& /*newer*/, FollowingMove& /*older*/) override {}
  void stop(const FollowingMove& following) override;
  bool conclude(FollowingMove& following) override;
  void watch(FollowingMove& following, bool tell) override;

  axis::Axis& axis_;
};

}  // namespace stepdriver::ros_node
