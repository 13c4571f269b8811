#pragma once

#include <actionlib/action_definition.h>
#include <ros/node_handle.h>

#include <algorithm>
#include <string>
#include <vector>

#include "action_topics.h"
#include "motion_action.h"
#include "move_end.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// A current goal of an action whose motion has several axes.
template <typename Action>
struct FollowingTogether {
  actionlib::ServerGoalHandle<Action> handle;
  machine::CoordinatedMove move;
  std::vector<double> began_at;  // [unit] the positions of its axes
  std::string preempted_by;      // a cancel, in words; empty: no cancel
  double progress = 0.0;         // as last reported
};

/// A service that moves several axes together, as an action. A goal is accepted once its motion
/// begins; until then its axes come to rest, or wait for the end of a hold, and a cancel stops
/// them.
///
/// @tparam Action MoveLineAction or FollowPathAction: their results have the same fields, and their
///   feedbacks those of a MoveLineAction.
template <typename Action>
class CoordinatedAction : public MotionAction<Action, FollowingTogether<Action>> {
  using Base = MotionAction<Action, FollowingTogether<Action>>;
  ACTION_DEFINITION(Action)

 protected:
  using Following = FollowingTogether<Action>;
  using GoalHandle = typename Base::GoalHandle;
  using States = std::vector<axis::AxisState>;

  /// Like the calls of the service, goals wait for their axes in a queue that has a thread for
  /// each.
  ///
  /// @param node the node's private handle.
  /// @param machine, queues, topics outlive the action.
  CoordinatedAction(const ros::NodeHandle& node, const std::string& name, machine::Machine& machine,
                    CallQueues& queues, ActionTopics& topics)
      : Base(onQueue(queues.lines(), node), name, topics, [this] { poll_.begin(); }),
        machine_(machine),
        poll_(onQueue(queues.control(), node), kPollPeriod, [this] { return this->poll(); }) {}

  machine::Machine& machine() { return machine_; }
  const machine::Machine& machine() const { return machine_; }

 private:
  /// Begins the motion. @throw Error if it is refused.
  virtual machine::CoordinatedMove move(const Goal& goal) = 0;
  /// The covered part of a motion, from 0 to 1. @param states of its axes, now.
  virtual double progressOfGoal(const Following& following, const States& states) const = 0;
  /// Adds the fields that only this action has.
  virtual void complete(const Following& /*following*/, Feedback& /*feedback*/) const {}
  virtual void completeResult(const machine::CoordinatedResult& /*ended*/,
                              Result& /*result*/) const {}

  Following begin(const GoalHandle& handle) override {
    Following following;
    following.handle = handle;
    following.move = move(*handle.getGoal());
    for (const axis::AxisState& state : statesOf(following)) {
      following.began_at.push_back(state.position);
    }
    return following;
  }

  void reject(GoalHandle& handle, const Error& error) override {
    Result result;
    result.end = Result::REFUSED;
    result.message = error.what();
    handle.setRejected(result, result.message);
  }

  void takeOver(const Following& /*newer*/, Following& /*older*/) override {}

  void stop(const Following& following) override { machine_.stop(following.move); }

  // A motion whose axes are stopped before it begins is refused.
  void cancelBeginning(const GoalHandle& handle) override {
    const auto& names = handle.getGoal()->name;
    for (const auto& axis : machine_.axes()) {
      if (std::find(names.begin(), names.end(), axis->config().name) != names.end()) axis->stop();
    }
  }

  bool conclude(Following& following) override {
    const auto ended = machine_.result(following.move);
    if (!ended) return false;
    Result result;
    result.end = endOf(ended->end);
    result.message = ended->message;
    result.position = ended->positions;
    result.duration = ended->duration;
    completeResult(*ended, result);
    reportEnd(following.handle, result, following.preempted_by);
    return true;
  }

  void watch(Following& following, bool tell) override {
    if (!tell) return;
    const States states = statesOf(following);
    Feedback feedback;
    for (const axis::AxisState& state : states) {
      feedback.position.push_back(state.position);
      feedback.velocity.push_back(state.velocity);
      feedback.time_left = std::max(feedback.time_left, state.time_left);
    }
    following.progress = progressOfGoal(following, states);
    feedback.progress = following.progress;
    complete(following, feedback);
    following.handle.publishFeedback(feedback);
  }

  States statesOf(const Following& following) const {
    States states;
    for (const auto& member : following.move.members) {
      states.push_back(machine_.axis(member.axis).state());
    }
    return states;
  }

  machine::Machine& machine_;
  PeriodicPoll poll_;
};

}  // namespace stepdriver::ros_node
