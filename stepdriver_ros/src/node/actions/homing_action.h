#pragma once

#include <ros/node_handle.h>
#include <stepdriver/HomeAction.h>
#include <stepdriver/HomeAxesAction.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "action_topics.h"
#include "serial_action.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// When a homing in progress is reported: at each new phase of an axis, and each 0.1 s.
class HomingReports {
 public:
  /// @param phases of the axes that are reported. @return whether a report is due.
  bool due(const std::vector<axis::HomingPhase>& phases);

 private:
  using Clock = std::chrono::steady_clock;

  std::vector<axis::HomingPhase> told_;
  Clock::time_point told_at_;
};

/// The action `homing` of one axis, below its name.
class HomingAction {
 public:
  /// @param node a handle below the axis's name, with the queue of the goals and cancels.
  /// @param axis, topics outlive the action; before its end the machine has been shut down.
  HomingAction(const ros::NodeHandle& node, axis::Axis& axis, ActionTopics& topics);
  ~HomingAction();

 private:
  using Goals = SerialAction<HomeAction>;

  void home(Goals::GoalHandle& goal, const std::function<bool()>& cancelled);

  axis::Axis& axis_;
  Goals goals_;  // last: its thread uses the others
};

/// The action ~homing of the whole machine: its axes in their configured order.
class MachineHomingAction {
 public:
  /// @param node the node's private handle, with the queue of the goals and cancels.
  /// @param machine, topics outlive the action; before its end the machine has been shut down.
  MachineHomingAction(const ros::NodeHandle& node, machine::Machine& machine, ActionTopics& topics);
  ~MachineHomingAction();

 private:
  using Goals = SerialAction<HomeAxesAction>;

  void home(Goals::GoalHandle& goal, const std::function<bool()>& cancelled);
  void report(Goals::GoalHandle& goal, HomingReports& reports) const;

  machine::Machine& machine_;
  Goals goals_;  // last: its thread uses the machine
};

}  // namespace stepdriver::ros_node
