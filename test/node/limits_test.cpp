#include <gtest/gtest.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/SetLimits.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// As configured: at most 100 mm/s and 500 mm/s^2.

namespace stepdriver::node_test {
namespace {

SetLimits::Response setLimits(NodeUnderTest& node, double max_speed, double acceleration = 0.0,
                              double deceleration = 0.0, double jerk = 0.0) {
  SetLimits::Request request;
  request.max_speed = max_speed;
  request.acceleration = acceleration;
  request.deceleration = deceleration;
  request.jerk = jerk;
  return node.call<SetLimits>("x/set_limits", request);
}

TEST(Limits, SaysWhatItHasChangedAndTheNextMoveKeepsToIt) {
  NodeUnderTest node;
  node.start();
  const auto lower = setLimits(node, 0.05, 0.0, 0.25, 2.0);
  EXPECT_TRUE(lower.success);
  EXPECT_EQ(lower.message,
            "x: max_speed 0.05 m/s instead of 0.1 m/s, deceleration 0.25 m/s^2 instead of "
            "0.5 m/s^2, jerk 2 m/s^3 instead of none");
  EXPECT_EQ(lower.max_speed, 0.05);
  EXPECT_EQ(lower.acceleration, 0.5);
  EXPECT_EQ(lower.deceleration, 0.25);
  EXPECT_EQ(lower.jerk, 2.0);
  EXPECT_GT(node.moveTo(0.1, true).duration, 2.0) << "1.2 s as configured";
  EXPECT_EQ(setLimits(node, 0.05, 0.0, 0.25, 2.0).message, "x: no limit has changed");

  const auto back = setLimits(node, 0.0);
  EXPECT_EQ(back.jerk, 0.0);
  expectSays(back.message, "jerk none instead of 2 m/s^3");
  EXPECT_NEAR(node.moveTo(0.0, true).duration, 1.2, 1e-3);
}

TEST(Limits, SlowDownAMoveUnderWay) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(node.moveTo(0.15, false).success);
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.velocity.at(0) > 0.0999; }));
  EXPECT_TRUE(setLimits(node, 0.04).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return std::abs(s.velocity.at(0) - 0.04) < 1e-9; }));
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return s.moving.at(0) == 0 && s.position.at(0) == 0.15; }));
  EXPECT_EQ(node.rig().violations.at(0), 0);
}

TEST(Limits, RefuseWhatIsBeyondTheConfiguredOnes) {
  NodeUnderTest node;
  node.start();
  const auto beyond = setLimits(node, 0.05, 0.6);
  EXPECT_FALSE(beyond.success);
  EXPECT_EQ(beyond.message,
            "x: the acceleration 0.6 m/s^2 is above 0.5 m/s^2, from the configuration");
  EXPECT_EQ(beyond.max_speed, 0.1) << "nothing is changed";
  for (const double bad :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const auto answer = setLimits(node, bad);
    EXPECT_FALSE(answer.success) << bad;
    expectSays(answer.message,
               " m/s, but must be a finite number above 0, or 0 for the configured");
  }
  const auto too_fast = setLimits(node, 0.05);
  EXPECT_TRUE(too_fast.success);
  const auto refused = node.moveTo(0.1, true, 0.06);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "above the maximum 0.05 m/s, from set_limits");
}

}  // namespace
}  // namespace stepdriver::node_test
