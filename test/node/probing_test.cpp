#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/LatchAction.h>
#include <stepdriver/LatchedPositions.h>
#include <stepdriver/Probe.h>
#include <stepdriver/ProbeAction.h>
#include <stepdriver/SetPosition.h>

#include <memory>
#include <string>
#include <vector>

#include "support/motion_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

// Probing and latched positions on the rig, where the carriage of x presses the probe from 30 mm
// on.

namespace stepdriver::node_test {
namespace {

class Probing : public testing::Test {
 protected:
  void start(double speed = 20.0) {
    node.set("simulation/speed", speed);
    node.set("inputs/probe/pin", "probe");
    node.set("inputs/probe/active_level", "high");
    node.set("inputs/probe/debounce_ms", 0.0);
    node.set("simulation/inputs/probe/axis", "x");
    node.set("simulation/inputs/probe/from_mm", 30.0);
    node.set("simulation/inputs/probe/to_mm", 300.0);
    addSecondAxis(node);
    node.start();
    EXPECT_TRUE(node.call<SetPosition>("x/set_position").success);
    EXPECT_TRUE(node.call<SetPosition>("y/set_position").success);
  }

  template <typename Fields>
  static Fields towards(double x) {
    Fields fields;
    fields.name = {"x"};
    fields.position = {x};
    fields.input = "probe";
    fields.velocity = 0.02;
    return fields;
  }

  Probe::Response probe(const Probe::Request& request) {
    return node.call<Probe>("probe", request);
  }

  NodeUnderTest node;
};

TEST_F(Probing, TouchesTwiceAndGoesBackToTheContact) {
  start();
  auto request = towards<Probe::Request>(0.1);
  request.second_velocity = 0.005;
  request.back_off = 0.002;
  request.go_back = true;
  const Probe::Response response = probe(request);
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_TRUE(response.contact);
  ASSERT_EQ(response.contact_position.size(), 1U);
  EXPECT_NEAR(response.contact_position[0], 0.03 - kHalfStep, 1e-8);
  EXPECT_FALSE(response.contact_was_read);
  ASSERT_EQ(response.position.size(), 1U);
  EXPECT_NEAR(response.position[0], response.contact_position[0], 1.01 * kHalfStep);
}

TEST_F(Probing, AlongALineOfTwoAxesTellsThePlaceOfBoth) {
  start();
  auto request = towards<Probe::Request>(0.1);
  request.name = {"x", "y"};
  request.position = {0.1, -0.05};
  const Probe::Response response = probe(request);
  EXPECT_TRUE(response.success) << response.message;
  ASSERT_EQ(response.contact_position.size(), 2U);
  EXPECT_NEAR(response.contact_position[0], 0.03 - kHalfStep, 1e-8);
  EXPECT_NEAR(response.contact_position[1], -0.015, kStep);
  EXPECT_GT(response.position.at(0), 0.03);
}

TEST_F(Probing, WithoutAContactFailsUnlessItMayMiss) {
  start();
  auto request = towards<Probe::Request>(0.02);
  Probe::Response response = probe(request);
  EXPECT_FALSE(response.success);
  EXPECT_FALSE(response.contact);
  expectSays(response.message, "the first touch met no contact at the input probe");
  request.position = {0.01};
  request.may_miss = true;
  response = probe(request);
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_TRUE(response.contact_position.empty());
  EXPECT_NEAR(response.position.at(0), 0.01, 1e-9);
}

TEST_F(Probing, AwayFromAContactMustBeginInIt) {
  start();
  auto request = towards<Probe::Request>(0.0);
  request.away = true;
  expectSays(probe(request).message, "the input probe is inactive already");
  EXPECT_TRUE(node.moveTo(0.04, true).success);
  expectSays(probe(towards<Probe::Request>(0.1)).message, "the input probe is active already");
  const Probe::Response response = probe(request);
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_NEAR(response.contact_position.at(0), 0.03 - kHalfStep, 1e-8);
  EXPECT_LT(response.position.at(0), 0.03);
}

TEST_F(Probing, RefusesWhatThereIsNotAndWhatIsBeyondALimit) {
  start();
  auto request = towards<Probe::Request>(0.1);
  request.input = "touch";
  expectSays(probe(request).message, "there is no input touch (inputs: probe)");
  request = towards<Probe::Request>(0.3);
  expectSays(probe(request).message, "0.2");
  request = towards<Probe::Request>(0.1);
  request.second_velocity = 0.01;
  expectSays(probe(request).message, "back_off above 0");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(Probing, AsAnActionTellsItsPlaceAndDeceleratesWhenItIsCancelled) {
  start(1.0);
  MotionClient<ProbeAction> client(node.full("probe"));
  std::vector<ProbeFeedback> told;
  client.sendGoal(towards<ProbeGoal>(0.1), {}, {},
                  [&](const ProbeFeedbackConstPtr& feedback) { told.push_back(*feedback); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 400; }));
  client.cancelGoal();
  EXPECT_EQ(client.await(), State::PREEMPTED);
  client.expectEnd(ProbeResult::CANCELLED, "it was cancelled");
  EXPECT_LT(client.getResult()->position.at(0), 0.03);
  EXPECT_GT(told.size(), 1U);
  EXPECT_EQ(client.run(towards<ProbeGoal>(0.1)), State::SUCCEEDED);
  client.expectEnd(ProbeResult::CONTACT, "there was a contact at the input probe");
  EXPECT_NEAR(client.getResult()->contact_position.at(0), 0.03 - kHalfStep, 1e-8);
  EXPECT_EQ(client.run(towards<ProbeGoal>(0.1)), State::ABORTED);
  client.expectEnd(ProbeResult::REFUSED, "active already");
}

TEST_F(Probing, AStopEndsIt) {
  start(1.0);
  MotionClient<ProbeAction> client(node.full("probe"));
  client.sendGoal(towards<ProbeGoal>(0.1));
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 400; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("stop").success);
  EXPECT_EQ(client.await(), State::ABORTED);
  client.expectEnd(ProbeResult::FAILED, "stopped");
}

TEST_F(Probing, AnotherActionLatchesTheFirstEdgeOrPublishesEach) {
  start();
  MotionClient<LatchAction> first(node.full("latch"));
  MotionClient<LatchAction> every(node.full("latch"));
  const Recorder<LatchedPositions> edges(node.full("latched_positions"));
  ASSERT_TRUE(waitUntil([&] { return edges.connected(); }));
  LatchGoal goal;
  goal.input = "probe";
  goal.name = {"x"};
  first.sendGoal(goal);
  goal.edge = LatchGoal::EITHER;
  goal.every = true;
  goal.name.clear();
  every.sendGoal(goal);
  ASSERT_TRUE(waitUntil(
      [&] { return first.getState() == State::ACTIVE && every.getState() == State::ACTIVE; }));
  EXPECT_TRUE(node.moveTo(0.04, true).success);
  EXPECT_TRUE(node.moveTo(0.0, true).success);
  EXPECT_EQ(first.await(), State::SUCCEEDED);
  const auto result = first.getResult();
  EXPECT_TRUE(result->latched);
  EXPECT_EQ(result->edges, 1U);
  EXPECT_EQ(result->last.name, std::vector<std::string>{"x"});
  EXPECT_NEAR(result->last.position.at(0), 0.03 - kHalfStep, 1e-8);
  ASSERT_TRUE(waitUntil([&] { return edges.count() >= 3; }))
      << "one of the first goal, two of the other";
  const LatchedPositions last = edges.messages().back();
  EXPECT_EQ(last.number, 2U);
  EXPECT_FALSE(last.active);
  EXPECT_EQ(last.input, "probe");
  EXPECT_EQ(last.name, (std::vector<std::string>{"x", "y"}));
  EXPECT_NEAR(last.position.at(0), 0.03 - kHalfStep, 1e-8);
  EXPECT_GT(last.header.stamp, ros::Time(0));
  every.cancelGoal();
  EXPECT_EQ(every.await(), State::PREEMPTED);
  EXPECT_EQ(every.getResult()->edges, 2U);
  goal.edge = 3;
  EXPECT_EQ(every.run(goal), State::REJECTED);
  expectSays(every.getResult()->message, "edge is 3, but must be 0 (ACTIVE)");
}

// The rig's line reports that the switch closes, and none of its bounces, which take a second each.
TEST_F(Probing, AnEdgeThatNoLineHasReportedIsMarkedAsRead) {
  node.set("inputs/touch/pin", "touch");
  node.set("inputs/touch/active_level", "high");
  node.set("inputs/touch/debounce_ms", 0.0);
  node.set("simulation/inputs/touch/bounces", 1000);
  node.set("simulation/inputs/touch/bounce_ms", 1000.0);
  start(1.0);
  MotionClient<LatchAction> client(node.full("latch"));
  const Recorder<LatchedPositions> edges(node.full("latched_positions"));
  ASSERT_TRUE(waitUntil([&] { return edges.connected(); }));
  LatchGoal goal;
  goal.input = "touch";
  goal.edge = LatchGoal::EITHER;
  goal.every = true;
  client.sendGoal(goal);
  ASSERT_TRUE(waitUntil([&] { return client.getState() == State::ACTIVE; }));
  std_srvs::SetBool::Request pressed;
  pressed.data = true;
  EXPECT_TRUE(node.call<std_srvs::SetBool>("rig/inputs/touch", pressed).success);
  ASSERT_TRUE(waitUntil([&] { return edges.count() >= 2; }));
  EXPECT_TRUE(edges.messages()[0].active);
  EXPECT_FALSE(edges.messages()[0].was_read);
  EXPECT_TRUE(edges.messages()[1].was_read);
  auto request = towards<Probe::Request>(0.03);
  request.input = "touch";
  request.away = true;
  request.velocity = 0.001;
  Probe::Response response;
  ASSERT_TRUE(waitUntil([&] {
    response = probe(request);
    return !response.position.empty();
  })) << response.message;
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_TRUE(response.contact_was_read);
  MotionClient<ProbeAction> action(node.full("probe"));
  auto again = towards<ProbeGoal>(0.03);
  again.input = "touch";
  again.away = true;
  again.velocity = 0.001;
  ASSERT_TRUE(waitUntil([&] { return action.run(again) == State::SUCCEEDED; }));
  EXPECT_TRUE(action.getResult()->contact_was_read);
}

}  // namespace
}  // namespace stepdriver::node_test
