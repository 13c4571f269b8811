#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <stepdriver/LatchAction.h>
#include <stepdriver/LatchedPositions.h>

#include <cstdint>
#include <string>

#include "action_topics.h"
#include "motion_action.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "node/machine_time.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// A current goal of the action ~latch.
struct Latching {
  actionlib::ServerGoalHandle<LatchAction> handle;
  machine::Latch latch;
  std::string preempted_by;  // a cancel, in words; empty: no cancel
  std::uint64_t edges = 0;   // as last reported
};

/// The action ~latch: the positions of axes at edges of an input. Each edge that counts is
/// published on ~latched_positions.
class LatchingAction : public MotionAction<LatchAction, Latching> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, topics, and the clock of the time, outlive the action.
  LatchingAction(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues,
                 ActionTopics& topics, const MachineTime& time);
  ~LatchingAction() override;

 private:
  Latching begin(const GoalHandle& handle) override;
  void reject(GoalHandle& handle, const Error& error) override;
  void takeOver(const Latching& /*newer*/, Latching& /*older*/) override {}
  void stop(const Latching& latching) override;
  bool conclude(Latching& latching) override;
  void watch(Latching& latching, bool tell) override;

  void publishEdges(Latching& latching);
  LatchedPositions messageOf(const Latching& latching, const machine::LatchedEdge& edge) const;

  machine::Machine& machine_;
  const MachineTime time_;
  ros::Publisher publisher_;
  PeriodicPoll poll_;
};

}  // namespace stepdriver::ros_node
