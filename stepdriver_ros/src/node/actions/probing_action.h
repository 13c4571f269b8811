#pragma once

#include <ros/node_handle.h>
#include <stepdriver/ProbeAction.h>

#include <functional>

#include "action_topics.h"
#include "serial_action.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The action ~probe: a line until an input tells of a contact.
class ProbingAction {
 public:
  /// @param node the node's private handle, with the queue of the goals and cancels.
  /// @param machine, topics outlive the action; before its end the machine has been shut down.
  ProbingAction(const ros::NodeHandle& node, machine::Machine& machine, ActionTopics& topics);
  ~ProbingAction();

 private:
  using Goals = SerialAction<ProbeAction>;

  void probe(Goals::GoalHandle& handle, const std::function<bool()>& cancelled);

  machine::Machine& machine_;
  Goals goals_;  // last: its thread uses the machine
};

}  // namespace stepdriver::ros_node
