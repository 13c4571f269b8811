#pragma once

#include <actionlib/server/action_server.h>
#include <actionlib_msgs/GoalID.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <functional>
#include <string>

#include "action_topics.h"
#include "common/latched_messages.h"
#include "node/calls/bounded.h"

namespace stepdriver::ros_node {

/// An action's topics, like actionlib::ActionServer, but one timer publishes the statuses of all
/// actions. A stamp in the future counts as the time of arrival: actionlib applies a cancel to all
/// goals up to its stamp, and doesn't check whether a sum of stamps is beyond the last time that
/// ros::Time can represent.
///
/// An action that has one defines its destructor in its source file: otherwise every file that uses
/// the action compiles all of actionlib's server for it.
template <typename Action>
class ActionServer : public actionlib::ActionServerBase<Action> {
  using Base = actionlib::ActionServerBase<Action>;

 public:
  ACTION_DEFINITION(Action)
  using GoalHandle = typename Base::GoalHandle;

  /// @param node with the queue of the goals and cancels.
  /// @param topics outlives the server.
  ActionServer(const ros::NodeHandle& node, const std::string& name, ActionTopics& topics,
               const std::function<void(const GoalHandle&)>& take,
               const std::function<void(const GoalHandle&)>& cancel)
      : Base(take, cancel), node_(node, name), topics_(topics) {}

 private:
  using Lock = boost::recursive_mutex::scoped_lock;

  static constexpr int kQueueSize = 50;
  static constexpr double kKeptInStatus = 5.0;  // [s] how long a goal stays after its end

  void initialize() override {
    this->status_list_timeout_ = ros::Duration(kKeptInStatus);
    result_publisher_ = node_.advertise<ActionResult>("result", kQueueSize);
    feedback_publisher_ = node_.advertise<ActionFeedback>("feedback", kQueueSize);
    status_publisher_ =
        node_.advertise<actionlib_msgs::GoalStatusArray>("status", kQueueSize, true);
    const boost::function<void(const boost::shared_ptr<const Bounded<ActionGoal>>&)> take =
        [this](const auto& goal) {
          if (goal->goal_id.stamp <= ros::Time::now()) return this->goalCallback(goal);
          const auto arrived = boost::make_shared<Bounded<ActionGoal>>(*goal);
          arrived->goal_id.stamp = ros::Time::now();
          this->goalCallback(arrived);
        };
    const boost::function<void(const boost::shared_ptr<const actionlib_msgs::GoalID>&)> cancel =
        [this](const auto& id) {
          const auto arrived = boost::make_shared<actionlib_msgs::GoalID>(*id);
          arrived->stamp = std::min(id->stamp, ros::Time::now());
          this->cancelCallback(arrived);
        };
    goal_subscriber_ = subscribeToNew(node_, "goal", kQueueSize, topics_.latched(), take);
    cancel_subscriber_ = node_.subscribe("cancel", kQueueSize, cancel);
    topics_.addStatus([this] { beat(); });
  }
  // Without goals or subscribers nothing is published: later subscribers get the last status.
  void beat() {
    const Lock lock(this->lock_);
    if (!this->status_list_.empty() || status_publisher_.getNumSubscribers() > 0) publishStatus();
  }

  void publishResult(const actionlib_msgs::GoalStatus& status, const Result& result) override {
    const Lock lock(this->lock_);
    send(result_publisher_, status, &ActionResult::result, result);
    publishStatus();
  }

  void publishFeedback(const actionlib_msgs::GoalStatus& status,
                       const Feedback& feedback) override {
    const Lock lock(this->lock_);
    send(feedback_publisher_, status, &ActionFeedback::feedback, feedback);
  }

  template <typename Message, typename Content>
  static void send(const ros::Publisher& publisher, const actionlib_msgs::GoalStatus& status,
                   Content Message::*place, const Content& content) {
    Message message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.*place = content;
    publisher.publish(message);
  }

  void publishStatus() override {
    const Lock lock(this->lock_);
    const ros::Time now = ros::Time::now();
    this->status_list_.remove_if([&](actionlib::StatusTracker<Action>& goal) {
      ros::Time& end = goal.handle_destruction_time_;
      // A cancel of an unknown goal has no handle that would set the time. Most have no stamp.
      if (end.isZero() && goal.handle_tracker_.expired()) end = now;
      return !end.isZero() && end + this->status_list_timeout_ < now;
    });
    actionlib_msgs::GoalStatusArray message;
    message.header.stamp = now;
    for (const auto& goal : this->status_list_) message.status_list.push_back(goal.status_);
    status_publisher_.publish(message);
  }

  ros::NodeHandle node_;
  ActionTopics& topics_;
  ros::Publisher result_publisher_;
  ros::Publisher feedback_publisher_;
  ros::Publisher status_publisher_;
  ros::Subscriber goal_subscriber_;
  ros::Subscriber cancel_subscriber_;
};

}  // namespace stepdriver::ros_node
