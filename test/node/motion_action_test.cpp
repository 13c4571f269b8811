#include "node/actions/motion_action.h"

#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <stepdriver/MoveAction.h>

#include <atomic>
#include <string>

#include "common/latched_messages.h"
#include "common/master_directory.h"
#include "node/actions/action_topics.h"
#include "support/motion_client.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

struct Motion {
  actionlib::ServerGoalHandle<MoveAction> handle;
  std::string preempted_by;
};

/// Its motions can't be stopped: they end when the test says so.
class Unstoppable : public ros_node::MotionAction<MoveAction, Motion> {
 public:
  Unstoppable(const ros::NodeHandle& node, ros_node::ActionTopics& topics)
      : MotionAction(node, "move", topics, [] {}) {
    start();
  }

  std::atomic<bool> ends{false};
  std::atomic<int> stops{0};

 private:
  Motion begin(const GoalHandle& handle) override { return {handle, {}}; }
  void reject(GoalHandle& handle, const Error& error) override {
    handle.setRejected({}, error.what());
  }
  void takeOver(const Motion& /*newer*/, Motion& /*older*/) override {}
  void stop(const Motion& /*motion*/) override {
    ++stops;
    throw GpioError("x: its line can't be written");
  }
  bool conclude(Motion& motion) override {
    if (ends) motion.handle.setCanceled({}, motion.preempted_by);
    return ends;
  }
  void watch(Motion& /*motion*/, bool /*tell*/) override {}
};

TEST(MotionAction, AGoalThatCannotBeStoppedStaysCurrentUntilItsMotionEnds) {
  const ros::NodeHandle node("motion_action");
  ros_node::MasterDirectory directory;
  ros_node::LatchedMessages latched(directory);
  ros_node::ActionTopics topics(node, 5.0, latched);
  Unstoppable action(node, topics);
  MotionClient<MoveAction> client(node.resolveName("move"));
  client.sendGoal({});
  ASSERT_TRUE(waitUntil([&] { return client.getState() == State::ACTIVE; }));
  client.cancelGoal();
  ASSERT_TRUE(waitUntil([&] { return action.stops == 1; })) << "the cancel doesn't stop it";
  EXPECT_TRUE(action.poll()) << "the goal is given up while its motion continues";
  EXPECT_FALSE(client.getState().isDone());
  action.ends = true;
  EXPECT_FALSE(action.poll());
  EXPECT_EQ(client.await(), State::PREEMPTED);
  EXPECT_EQ(client.getState().getText(), "it was cancelled");
}

}  // namespace
}  // namespace stepdriver::node_test
