#include <gtest/gtest.h>

#include <cerrno>
#include <vector>

#include "support/constants.h"
#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

using test::kMillisecond;

constexpr int kInPosition = 0;

/// Two channels; the first has an in-position input that is active high, and waits 100 ms for it.
class InPosition : public PulseEngineTest {
 protected:
  void SetUp() override {
    ChannelConfig first = config(0);
    first.in_position = Signal{kInPosition, true};
    first.in_position_timeout = 100 * kMillisecond;
    make({first, config(1)});
    lines.inputs[kInPosition] = 0;
  }

  /// 10 steps of 1 ms from 1 ms on.
  void order(int channel = 0, bool settles = true, std::uint64_t group = 0) {
    Follow& order = plan(cruise(kMillisecond, 0, 10, 1000.0), channel);
    order.group = group;
    order.settles = settles;
  }
};

TEST_F(InPosition, EndsAMotionWhenItComes) {
  order();
  postFollows(1);
  runUntil(40 * kMillisecond);
  EXPECT_EQ(engine->channel(0).count, 10);
  EXPECT_NE(engine->channel(0).following, 0U);
  lines.inputs[kInPosition] = 1;
  runUntil(42 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_GE(engine->channel(0).end_time, 40 * kMillisecond);
}

TEST_F(InPosition, IsReadAtOnceWhenAnEdgeIsReported) {
  order();
  postFollows(1);
  runUntil(40 * kMillisecond + 300'000);
  lines.inputs[kInPosition] = 1;
  engine->inputsChanged();
  engine->serve();
  EXPECT_EQ(engine->channel(0).following, 0U);
}

TEST_F(InPosition, EndsAMotionAsAFaultAfterItsTimeout) {
  order();
  postFollows(1);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kNotInPosition);
  EXPECT_EQ(engine->channel(0).waited, 100 * kMillisecond);
  EXPECT_FALSE(engine->channel(0).end_abrupt);
  EXPECT_EQ(clock.now(), 111 * kMillisecond);
}

TEST_F(InPosition, IsNotAwaitedByAnOrderThatDoesNotSettle) {
  order(0, false);
  postFollows(1);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(clock.now(), 11 * kMillisecond);
}

TEST_F(InPosition, IsNotAwaitedAfterAnEmergencyStop) {
  order();
  postFollows(1);
  runUntil(40 * kMillisecond);
  engine->emergencyStop();
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kEmergencyStop);
  EXPECT_EQ(engine->stopsServed(), 1U);
  EXPECT_EQ(clock.now(), 40 * kMillisecond);
}

TEST_F(InPosition, ThatCannotBeReadEndsTheMotionByALineError) {
  order();
  postFollows(1);
  runUntil(40 * kMillisecond);
  lines.inputs[kInPosition] = -EIO;
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kLineError);
  EXPECT_EQ(engine->channel(0).failure.line, kInPosition);
  EXPECT_EQ(engine->channel(0).failure.error, EIO);
}

TEST_F(InPosition, OfOneChannelOfAGroupDoesNotHoldUpTheOther) {
  order(0, true, 7);
  order(1, true, 7);
  postFollows(2);
  runUntil(20 * kMillisecond);
  EXPECT_EQ(engine->channel(1).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(1).following, 0U);
  EXPECT_NE(engine->channel(0).following, 0U);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kNotInPosition);
}

TEST_F(InPosition, IsAwaitedNoLongerForAPlanWithoutAStep) {
  order();
  postFollows(1);
  runUntil(60 * kMillisecond);
  plan(motion::planFromRest(61 * kMillisecond, 10, 10, {1000.0, 1000.0, 1.0, 1.0}), 0, 1).settles =
      true;
  postFollows(1);
  runOut();
  EXPECT_EQ(engine->channel(0).accepted, 2U);
  EXPECT_EQ(engine->channel(0).end, EndReason::kNotInPosition);
  EXPECT_EQ(clock.now(), 111 * kMillisecond) << "the wait goes on from the last step";
}

}  // namespace
}  // namespace stepdriver::pulse
