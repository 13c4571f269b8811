#include <gtest/gtest.h>
#include <ros/node_handle.h>

#include <string>

#include "common/latched_messages.h"
#include "common/master_directory.h"
#include "core/support/bench.h"
#include "node/actions/action_topics.h"
#include "node/actions/trajectory_action.h"
#include "node/calls/call_queues.h"
#include "support/control_msgs_client.h"
#include "support/says.h"
#include "support/wait.h"

// Tests the end of a node with an active goal, when its threads no longer serve anything.

namespace stepdriver::node_test {
namespace {

using State = actionlib::SimpleClientGoalState;

TEST(TrajectoryAtTheEnd, IsTheClientToldOfByTheThreadThatEndsTheNode) {
  const ros::NodeHandle node("trajectory_end");
  test::Bench bench({test::linearAxis("x")});
  ros_node::CallQueues queues(1);  // without threads
  ros_node::MasterDirectory directory;
  ros_node::LatchedMessages latched(directory);
  ros_node::ActionTopics topics(node, 5.0, latched);
  ros_node::TrajectoryAction action(node, *bench.machine, queues, topics, false);
  TrajectoryClient client(node.resolveName("follow_joint_trajectory"), false);
  const auto serve_until = [&](const auto& condition) {
    return waitUntil([&] {
      queues.trajectories().callAvailable();
      return condition();
    });
  };
  ASSERT_TRUE(serve_until([&] { return client.isServerConnected(); }));

  action_msgs::FollowJointTrajectoryGoal goal;
  goal.trajectory.joint_names = {"x"};
  goal.trajectory.points.resize(1);
  goal.trajectory.points[0].positions = {0.05};
  goal.trajectory.points[0].velocities = {0.0};
  goal.trajectory.points[0].time_from_start = ros::Duration(10.0);
  client.sendGoal(goal);
  ASSERT_TRUE(serve_until([&] { return client.getState() == State::ACTIVE; }));
  bench.machine->advance(1.0);

  bench.machine->shutdown();
  action.reportEnded();
  ASSERT_TRUE(waitUntil([&] { return client.getState().isDone(); })) << "no result comes";
  EXPECT_EQ(client.getState(), State::ABORTED);
  expectSays(client.getResult()->error_string, "the machine was shut down");
}

}  // namespace
}  // namespace stepdriver::node_test
