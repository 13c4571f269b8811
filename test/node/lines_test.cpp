#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/MoveLine.h>

#include <cmath>
#include <functional>
#include <future>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/vcd_reader.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

class LinesTest : public testing::Test {
 protected:
  LinesTest() { addSecondAxis(node); }

  MoveLine::Response moveLine(const std::vector<double>& positions, bool wait,
                              const std::function<void(MoveLine::Request&)>& change = {}) {
    MoveLine::Request request;
    request.name = {"x", "y"};
    request.position = positions;
    request.wait = wait;
    if (change) change(request);
    return node.call<MoveLine>("move_line", request);
  }

  std_srvs::Trigger::Response trigger(const std::string& service) {
    return node.call<std_srvs::Trigger>(service);
  }

  void expectNoViolation() {
    const auto report = node.rig();
    for (std::size_t i = 0; i < report.violations.size(); ++i) {
      EXPECT_EQ(report.violations[i], 0) << report.name[i] << ": " << report.violation_kinds[i];
    }
  }

  NodeUnderTest node;
};

TEST_F(LinesTest, EndsTogetherAtTheTargets) {
  const std::string trace = node.traced();
  node.start();
  const auto answer = moveLine({0.08, -0.02}, true);
  EXPECT_TRUE(answer.success) << answer.message;
  ASSERT_EQ(answer.position.size(), 2U);
  EXPECT_NEAR(answer.position[0], 0.08, kHalfStep);
  EXPECT_NEAR(answer.position[1], -0.02, kHalfStep);
  // x may use all of its speed and acceleration: 0.08 / 0.1 + 0.1 / 0.5
  EXPECT_NEAR(answer.duration, 1.0, 0.01);
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{6400, 0}));
  EXPECT_EQ(report.pulses_backward, (std::vector<std::int64_t>{0, 1600}));
  expectNoViolation();
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound), 0);
  const auto waves = readVcd(trace);
  // The last step of y is half a step of y from the end, so x has at most two more.
  const double apart = std::abs(
      static_cast<double>(waves.at("x/step").lastEdgeTime() - waves.at("y/step").lastEdgeTime()));
  EXPECT_LT(apart * 1e-9, std::sqrt(2.0 * 4.0 / 80000.0 / 0.5)) << "of x's last four steps";
}

TEST_F(LinesTest, AnswersOnAcceptanceWithTargetsAndPlannedDuration) {
  node.set("simulation/speed", 1.0);
  node.start();
  const auto answer = moveLine({0.1, 0.04}, false);
  EXPECT_TRUE(answer.success) << answer.message;
  ASSERT_EQ(answer.position.size(), 2U);
  EXPECT_NEAR(answer.position[0], 0.1, 1e-9);
  EXPECT_NEAR(answer.position[1], 0.04, 1e-9);
  EXPECT_NEAR(answer.duration, 1.2, 0.01);
  expectSays(answer.message, "a line: x to 0.1 m, y to 0.04 m in 1.2");
  EXPECT_LT(node.pulses(), 11200) << "the answer came after the line";
}

TEST_F(LinesTest, KeepsToAVelocityADurationAndRelativeTargets) {
  node.start();
  EXPECT_TRUE(moveLine({0.01, 0.01}, true).success);
  const auto slow = moveLine({0.03, 0.04}, true, [](MoveLine::Request& r) {
    r.relative = true;
    r.velocity = 0.025;  // along the line of 0.05 m, which takes 2 s and the ramps
  });
  EXPECT_TRUE(slow.success) << slow.message;
  ASSERT_EQ(slow.position.size(), 2U);
  EXPECT_NEAR(slow.position[0], 0.04, kHalfStep);
  EXPECT_NEAR(slow.position[1], 0.05, kHalfStep);
  EXPECT_NEAR(slow.duration, 2.04, 0.02);
  const auto timed = moveLine({0.0, 0.0}, true, [](MoveLine::Request& r) { r.duration = 3.0; });
  EXPECT_TRUE(timed.success) << timed.message;
  EXPECT_NEAR(timed.duration, 3.0, 0.01);
  expectNoViolation();
}

TEST_F(LinesTest, MovesNothingWhereItIsRefused) {
  node.start();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using Change = std::function<void(MoveLine::Request&)>;
  const std::vector<std::pair<Change, std::string>> bad = {
      {[](auto& r) {
         r.name = {"x", "z"};
       },
       "there is no axis z (axes: x, y)"},
      {[](auto& r) {
         r.name = {"x", "x"};
       },
       "the axis x is named twice"},
      {[](auto& r) { r.name.clear(); }, "no axis is named (axes: x, y)"},
      {[](auto& r) { r.position = {0.01}; }, "there are 2 names, but 1 positions"},
      {[nan](auto& r) { r.position[1] = nan; },
       "y: the position is nan m, but must be a finite number"},
      {[](auto& r) { r.position[1] = 0.3; }, "0.2 m"},
      {[](auto& r) { r.velocity = -1.0; }, "the velocity of the line is -1"},
      {[nan](auto& r) { r.duration = nan; }, "the duration of the line is nan"},
      {[](auto& r) { r.velocity = r.duration = 1.0; }, "a velocity, 1, and a duration, 1 s"},
  };
  for (const auto& [change, words] : bad) {
    const auto answer = moveLine({0.01, 0.01}, true, change);
    EXPECT_FALSE(answer.success) << words;
    expectSays(answer.message, words);
    EXPECT_TRUE(answer.position.empty()) << words;
    EXPECT_EQ(answer.duration, 0.0) << words;
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(LinesTest, StopsAllWhereOneIsStopped) {
  node.set("simulation/speed", 1.0);
  node.start();
  std::future<MoveLine::Response> line = std::async(std::launch::async, [this] {
    return moveLine({0.2, 0.1}, true);
  });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 3000; }));
  EXPECT_TRUE(trigger("y/stop").success) << "a line that waits holds up no other call";
  const auto answer = line.get();
  EXPECT_FALSE(answer.success);
  ASSERT_EQ(answer.position.size(), 2U);
  EXPECT_GT(answer.position[0], 0.0);
  EXPECT_LT(answer.position[0], 0.19);
  EXPECT_NEAR(answer.position[1], 0.5 * answer.position[0], 3.0 * kHalfStep) << "on the line";
  expectSays(answer.message, "stopped");
  expectNoViolation();
}

TEST_F(LinesTest, HoldsAndGoesOnToTheTargets) {
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  std::future<MoveLine::Response> line = std::async(std::launch::async, [this] {
    return moveLine({0.1, 0.05}, true);
  });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 3000; }));
  EXPECT_TRUE(trigger("hold").success);
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.held.at(0) != 0 && s.held.at(1) != 0 && s.moving.at(0) == 0 && s.moving.at(1) == 0;
  }));
  EXPECT_LT(node.pulses(), 12000);
  EXPECT_TRUE(trigger("resume").success);
  const auto answer = line.get();
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.pulses(), 12000);
  ASSERT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return s.held.at(0) == 0 && s.held.at(1) == 0; }));
  expectNoViolation();
}

TEST_F(LinesTest, ALineThatWaitsHoldsUpNoLineOfOtherAxes) {
  node.set("simulation/speed", 1.0);
  node.start();
  const auto line = [this](const std::string& axis, double position, double duration) {
    return moveLine({position}, true, [&](MoveLine::Request& request) {
      request.name = {axis};
      request.duration = duration;
    });
  };
  std::future<MoveLine::Response> slow =
      std::async(std::launch::async, [&] { return line("x", 0.1, 1000.0); });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 0; }));
  std::future<MoveLine::Response> fast =
      std::async(std::launch::async, [&] { return line("y", 0.001, 0.0); });
  EXPECT_EQ(fast.wait_for(kBound), std::future_status::ready);
  EXPECT_NE(slow.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  EXPECT_TRUE(trigger("stop").success);
  EXPECT_FALSE(slow.get().success);
  const auto answer = fast.get();
  EXPECT_TRUE(answer.success) << answer.message;
}

TEST_F(LinesTest, AnswersEveryOneOfManyThatComeAtOnce) {
  node.start();
  constexpr int kLines = 12;
  std::vector<std::future<MoveLine::Response>> lines;
  lines.reserve(kLines);
  for (int i = 0; i < kLines; ++i) {
    lines.push_back(std::async(std::launch::async, [this, i] {
      return moveLine({0.01 * i, 0.1}, true);
    }));
  }
  int reached = 0;
  for (auto& line : lines) {
    ASSERT_EQ(line.wait_for(kBound), std::future_status::ready);
    const auto answer = line.get();
    reached += answer.success ? 1 : 0;
    EXPECT_FALSE(answer.message.empty());
  }
  EXPECT_GE(reached, 1) << "the last of them";
  expectNoViolation();
}

}  // namespace
}  // namespace stepdriver::node_test
