#pragma once

#include <ros/node_handle.h>

#include <deque>

#include "action_topics.h"
#include "move_action.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The actions `move` of all axes. The axes' queues handle their goals.
class MoveActions {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, topics outlive the actions.
  MoveActions(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
              ActionTopics& topics)
      : poll_(onQueue(queues.control(), node), kPollPeriod, [this] { return poll(); }) {
    for (std::size_t i = 0; i < machine.axes().size(); ++i) {
      axis::Axis& axis = *machine.axes()[i];
      actions_.emplace_back(onQueue(queues.ofAxis(i), ros::NodeHandle(node, axis.config().name)),
                            axis, topics, [this] { poll_.begin(); });
    }
  }
  MoveActions(const MoveActions&) = delete;
  MoveActions& operator=(const MoveActions&) = delete;

  /// Reports ended goals to their clients; after the machine has been shut down, these are all
  /// goals.
  void reportEnded() {
    for (AxisMoveAction& action : actions_) action.reportEnded();
  }

 private:
  bool poll() {
    bool more = false;
    for (AxisMoveAction& action : actions_) more = action.poll() || more;
    return more;
  }

  std::deque<AxisMoveAction> actions_;
  PeriodicPoll poll_;
};

}  // namespace stepdriver::ros_node
