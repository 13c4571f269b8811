#pragma once

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/duration.h>

#include <string>

#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {

using State = actionlib::SimpleClientGoalState;

/// A client of one of the node's actions that are motions, MoveAction or MoveLineAction. The main
/// program's threads serve its callbacks.
template <typename Action>
class MotionClient : public actionlib::SimpleActionClient<Action> {
 public:
  ACTION_DEFINITION(Action)

  /// Returns when the action's server is connected. @param name full name of the action.
  explicit MotionClient(const std::string& name)
      : actionlib::SimpleActionClient<Action>(name, false) {
    EXPECT_TRUE(this->waitForServer(ros::Duration(kBound.count()))) << name << " isn't there";
  }

  /// @return how the current goal ended.
  State await() {
    EXPECT_TRUE(this->waitForResult(ros::Duration(kBound.count()))) << "no result comes";
    return this->getState();
  }
  State run(const Goal& goal) {
    this->sendGoal(goal);
    return await();
  }
  /// @param end a constant of the action's result. @param words in its message.
  void expectEnd(int end, const std::string& words) {
    const auto result = this->getResult();
    EXPECT_EQ(result->end, end) << result->message;
    expectSays(result->message, words);
    EXPECT_EQ(this->getState().getText(), result->message);
  }
};

}  // namespace stepdriver::node_test
