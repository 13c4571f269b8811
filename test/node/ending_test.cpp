#include <gtest/gtest.h>
#include <stepdriver/AxisStates.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <future>
#include <string>

#include "support/ask_node.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/two_axes.h"
#include "support/vcd_reader.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

// Whatever else the computer does, the test comes in the middle of this move, which takes 1000 s.
constexpr double kFar = 20.0;        // m
constexpr double kSlowSpeed = 20.0;  // mm/s
constexpr int kUnderWay = 400;       // steps

void makeLong(NodeUnderTest& node) {
  node.set("simulation/speed", 1.0);
  node.set("axes/x/max_speed_mm_s", kSlowSpeed);
  node.set("axes/x/max_position_mm", kFar * 1e3);
}

void end(NodeUnderTest& node, const std::string& how) {
  if (how == "SIGINT") node.process().signal(SIGINT);
  if (how == "SIGTERM") node.process().signal(SIGTERM);
  if (how == "SIGHUP") node.process().signal(SIGHUP);
  if (how == "SIGQUIT") node.process().signal(SIGQUIT);
  if (how == "kill") askNode(node.name(), "shutdown", "asked by a test");  // as rosnode kill does
}

class Ending : public testing::TestWithParam<std::string> {};

TEST_P(Ending, DuringAMoveDeceleratesDisablesAndAnswersTheWaitingClient) {
  NodeUnderTest node;
  makeLong(node);
  const std::string trace = node.traced();
  node.start();
  auto waiting = std::async(std::launch::async, [&node] { return node.moveTo(kFar, true); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > kUnderWay; }));

  end(node, GetParam());
  const auto exit_code = node.process().waitForExit(kBound);
  ASSERT_TRUE(exit_code) << "it still runs";
  EXPECT_EQ(*exit_code, 0) << node.process().output();

  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "shut down");

  auto pins = readVcd(trace);
  std::remove(trace.c_str());
  EXPECT_FALSE(pins["x/step"].last());
  EXPECT_TRUE(pins["x/enable"].last()) << "ENABLE is active low: high is disabled";
  const std::int64_t steps = pins["x/step"].changesTo(true);
  EXPECT_EQ(steps, std::llround(answer.position * 80000.0));
  EXPECT_GT(steps, kUnderWay);
  EXPECT_LT(steps, std::llround(kFar * 80000.0));
  // It decelerated: the last two steps of a ramp of 40,000 steps/s^2 are milliseconds apart.
  const auto& edges = pins["x/step"].edges;
  EXPECT_GT(edges[edges.size() - 2].time_ns - edges[edges.size() - 4].time_ns, 1'000'000);
  EXPECT_GE(pins["x/enable"].lastEdgeTime(), pins["x/step"].lastEdgeTime());
}

TEST_P(Ending, AtRestDisables) {
  NodeUnderTest node;
  const std::string trace = node.traced();
  node.start();
  end(node, GetParam());
  const auto exit_code = node.process().waitForExit(kBound);
  ASSERT_TRUE(exit_code) << "it still runs";
  EXPECT_EQ(*exit_code, 0) << node.process().output();
  auto pins = readVcd(trace);
  std::remove(trace.c_str());
  EXPECT_TRUE(pins["x/enable"].last());
  EXPECT_EQ(pins["x/step"].changesTo(true), 0);
}

INSTANTIATE_TEST_SUITE_P(How, Ending,
                         testing::Values("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "kill"),
                         [](const auto& value) { return value.param; });

TEST(EndingSlowly, RefusesNewMovesWhileItDecelerates) {
  NodeUnderTest node;
  makeLong(node);
  node.set("axes/x/deceleration_mm_s2", 0.1);  // 200 seconds to stop
  addSecondAxis(node);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(node.moveTo(kFar, false).success);
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 1000; }));
  node.process().signal(SIGTERM);
  // A stop is visible in the target, which becomes the position at which the axis will be at rest.
  ASSERT_TRUE(states.waitFor(
      [](const AxisStates& s) { return s.moving.at(0) != 0 && s.target.at(0) < 0.99 * kFar; }));
  MoveTo::Request request;
  request.position = 0.01;
  const auto answer = node.call<MoveTo>("y/move_to", request);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "shut down");
  EXPECT_FALSE(node.process().waitForExit(std::chrono::seconds(0))) << "it still decelerates";
}

TEST(EndingUnderNohup, TakesNoNoticeOfAClosedTerminal) {
  NodeUnderTest node;
  const auto before = std::signal(SIGHUP, SIG_IGN);  // a process inherits that
  node.start();
  std::signal(SIGHUP, before);
  end(node, "SIGHUP");
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  end(node, "SIGTERM");
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  expectSays(node.process().output(), "Ending on SIGTERM");
}

TEST(EndingForAnother, IsNotAskedOfByOneWithAWrongConfiguration) {
  NodeUnderTest node;
  node.start();
  node.set("axes/x/microsteps", 3);
  const std::string space = node.name().substr(0, node.name().rfind('/'));
  NodeProcess second({"__ns:=" + space, "__name:=stepdriver"});
  ASSERT_EQ(second.waitForExit(kBound).value_or(-1), 1) << second.output();
  expectSays(second.output(), "/axes/x/microsteps is 3, but must be");
  const auto answer = node.moveTo(0.001, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.process().output().find("Ending"), std::string::npos);
}

// As always in ROS, the name goes to the newer node.
TEST(EndingForAnother, IsAskedOfByOneOfTheSameNameWhichMovesNothing) {
  NodeUnderTest node;
  makeLong(node);
  node.start();
  auto waiting = std::async(std::launch::async, [&node] { return node.moveTo(kFar, true); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > kUnderWay; }));
  const std::string space = node.name().substr(0, node.name().rfind('/'));
  NodeProcess second({"__ns:=" + space, "__name:=stepdriver"});
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 0) << node.process().output();
  expectSays(node.process().output(), "Ending on a shutdown call");
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "shut down");
  EXPECT_LT(answer.position, 0.99 * kFar) << "it decelerates before its target";

  const auto says = [&second](const char* words) {
    return second.output().find(words) != std::string::npos;
  };
  ASSERT_TRUE(waitUntil([&] { return says("Ready"); })) << second.output();
  EXPECT_EQ(node.pulses(), 0) << "nobody has asked the second one to move";
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  EXPECT_EQ(node.pulses(), 80);
  second.signal(SIGTERM);
  EXPECT_EQ(second.waitForExit(kBound).value_or(-1), 0) << second.output();
}

// The first one ends in order; the second one doesn't share its file, and says why.
TEST(EndingForAnother, IsAskedOfByOneThatThenFindsTheStateFileInUse) {
  NodeUnderTest node;
  const TemporaryFile state(".state");
  const TemporaryFile lock(".state.lock");
  node.set("state_file", state.path());
  node.set("simulation/speed", 1.0);
  node.set("axes/x/max_speed_mm_s", 50.0);
  node.set("axes/x/deceleration_mm_s2", 12.5);  // four seconds to stop
  node.start();
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 1000; }));
  const std::string space = node.name().substr(0, node.name().rfind('/'));
  NodeProcess second({"__ns:=" + space, "__name:=stepdriver"});
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0) << node.process().output();
  const auto ready = [&second] { return second.output().find("Ready") != std::string::npos; };
  ASSERT_TRUE(waitUntil([&] { return ready() || second.waitForExit(std::chrono::seconds(0)); }));
  if (ready()) return;  // the first one was quicker
  EXPECT_EQ(second.waitForExit(kBound).value_or(-1), 1);
  expectSays(second.output(), "is used by another program: each node needs its own");
}

TEST(EndingEnabled, LeavesTheMotorOnWhereConfiguredSo) {
  NodeUnderTest node;
  node.set("axes/x/disable_on_shutdown", false);
  const std::string trace = node.traced();
  node.start();
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  end(node, "SIGTERM");
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  auto pins = readVcd(trace);
  std::remove(trace.c_str());
  EXPECT_FALSE(pins["x/enable"].last()) << "ENABLE is active low: low is enabled";
}

}  // namespace
}  // namespace stepdriver::node_test
