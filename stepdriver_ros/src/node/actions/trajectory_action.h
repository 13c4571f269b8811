#pragma once

#include <ros/node_handle.h>

#include <optional>
#include <string>
#include <vector>

#include "action_topics.h"
#include "follow_joint_trajectory.h"
#include "motion_action.h"
#include "node/calls/call_queues.h"
#include "node/calls/periodic_poll.h"
#include "node/topics/trajectory_message.h"
#include "stepdriver_core/machine/machine.h"
#include "trajectory_tolerances.h"

namespace stepdriver::ros_node {

/// A current goal of ~follow_joint_trajectory.
struct FollowingTrajectory {
  actionlib::ServerGoalHandle<action_msgs::FollowJointTrajectoryAction> handle;
  machine::CoordinatedMove move;
  std::vector<TrajectoryJoint> joints;
  TrajectoryTolerances tolerances;
  std::vector<double> goal;           // [unit] the last point
  std::vector<double> goal_velocity;  // [unit/s] the last point's; empty: it gives none
  MeanVelocities velocities;
  ros::Time began;
  std::optional<double> wanted_duration;  // [s] up to the last point; empty: its stamp isn't 0
  double slipped_before = 0.0;            // [s] slip of the machine's timeline
  std::string preempted_by;               // a cancel or a newer goal, in words; otherwise empty
  std::string followed_by;                // a newer goal that begins later, in words
  bool begins_later = false;              // its stamp lay ahead when it was accepted
  std::string violated;                   // a path tolerance, in words; empty: not violated
};

/// The action ~follow_joint_trajectory. A goal is checked before it is accepted. A goal that shares
/// a joint with a current one takes over without a stop; others run side by side.
class TrajectoryAction
    : public MotionAction<action_msgs::FollowJointTrajectoryAction, FollowingTrajectory> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, topics outlive the action.
  /// @param allow_slower see motion::TrajectoryRequest.
  TrajectoryAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
                   ActionTopics& topics, bool allow_slower);
  ~TrajectoryAction() override;

 private:
  using Following = FollowingTrajectory;

  /// The states of a goal's joints, in their order.
  struct Places : JointPlaces {
    std::vector<double> velocities;
  };

  TrajectoryJoint jointOf(const std::string& name) const;
  Following begin(const GoalHandle& handle) override;
  void reject(GoalHandle& handle, const Error& error) override;
  void takeOver(const Following& newer, Following& older) override;
  void stop(const Following& following) override;
  bool conclude(Following& following) override;
  void watch(Following& following, bool tell) override;

  /// @return the reason why it isn't a success; empty if it is.
  std::string shortOfGoal(const Following& following,
                          const machine::CoordinatedResult& result) const;
  Places placesOf(const Following& following) const;
  void keepToPath(Following& following, const Places& places);
  static void publishFeedback(Following& following, const Places& places);

  machine::Machine& machine_;
  const AxisOfJoint axes_;
  const bool allow_slower_;
  PeriodicPoll poll_;
};

}  // namespace stepdriver::ros_node
