#pragma once

#include <actionlib/server/action_server.h>
#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <list>
#include <mutex>
#include <string>
#include <vector>

#include "call_queues.h"
#include "follow_joint_trajectory.h"
#include "stepdriver_core/machine/machine.h"
#include "trajectory_message.h"
#include "trajectory_tolerances.h"

namespace stepdriver::ros_node {

/// The action ~follow_joint_trajectory. A goal is judged before it is accepted; one that shares a
/// joint with a goal under way takes over from it without a stop, others run side by side.
class TrajectoryAction {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues outlive the action.
  TrajectoryAction(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues);
  TrajectoryAction(const TrajectoryAction&) = delete;
  TrajectoryAction& operator=(const TrajectoryAction&) = delete;

  /// Tells the clients of goals that have ended; after the machine has been shut down that is all.
  void tellEnded();

 private:
  using Server = actionlib::ActionServer<action_msgs::FollowJointTrajectoryAction>;

  /// A goal under way.
  struct Following {
    Server::GoalHandle handle;
    machine::CoordinatedMove move;
    std::vector<std::string> joints;
    TrajectoryTolerances tolerances;
    std::vector<double> goal;  // [unit] the last point
    ros::Time began;
    double slipped_before = 0.0;  // [s] by the machine's timeline
    std::string preempted_by;     // a cancel or a newer goal, in words; empty: neither
    std::string violated;         // a path tolerance, in words; empty: none
  };
  /// Where the joints of a goal are, in their order.
  struct Places {
    std::vector<double> planned;
    std::vector<double> actual;
    std::vector<double> velocities;
  };

  void take(const Server::GoalHandle& goal);
  void cancel(const Server::GoalHandle& handle);
  void look();

  Following begin(const Server::GoalHandle& handle);
  void takeOver(const Following& newer);
  void concludeEnded();
  void conclude(Following& following, const machine::CoordinatedResult& result);
  /// @return why it isn't a success, in words; empty: it is.
  std::string shortOfGoal(const Following& following,
                          const machine::CoordinatedResult& result) const;
  void stop(const Following& following);
  Places placesOf(const Following& following) const;
  void keepToPath(Following& following, const Places& places);
  static void publishFeedback(Following& following, const Places& places);

  machine::Machine& machine_;
  const AxisOfJoint axes_;
  std::mutex mutex_;
  Server server_;
  std::list<Following> under_way_;
  int looks_ = 0;
  ros::SteadyTimer timer_;
};

}  // namespace stepdriver::ros_node
