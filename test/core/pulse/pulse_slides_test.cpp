#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "support/constants.h"
#include "support/pulse_engine_bench.h"

// Effects of a late pulse and a slow write on the other channels, and what remains of them later.

namespace stepdriver::pulse {
namespace {

using test::kMillisecond;

class PulseSlides : public PulseEngineTest {
 protected:
  void waitUntil(Nanoseconds time) {
    while (clock.now() < time) clock.waitUntil(time);
  }

  /// One pass in which each write takes this long.
  void serveSlowly(Nanoseconds write_cost) {
    lines.write_cost = write_cost;
    engine->serve();
    lines.write_cost = 0;
  }
};

TEST_F(PulseSlides, ABitLateStepIsPutOffByTheSlideForAMuchLaterOne) {
  make({config(0), config(1)}, 1'000 * kMillisecond);
  follow(cruise(3'600'000, 0, 1, 1000.0), 0);        // due at 4.1 ms, 0.5 ms after its start
  follow(cruise(1 * kMillisecond, 0, 1, 100.0), 1);  // due at 6 ms, 5 ms after it
  runUntil(4 * kMillisecond);
  waitUntil(6'100'000);
  engine->serve();
  const Nanoseconds slipped = 2 * kMillisecond - 125'000;
  ASSERT_EQ(engine->state().slipped, slipped);
  ASSERT_EQ(lines.rises(0), std::vector<Nanoseconds>{6'100'000});
  ASSERT_EQ(lines.rises(2), std::vector<Nanoseconds>{}) << "its time is to come again";
  runUntil(7 * kMillisecond);
  waitUntil(6 * kMillisecond + slipped + 40'000);
  runOut();
  EXPECT_EQ(lines.rises(2), std::vector<Nanoseconds>{6 * kMillisecond + slipped + 40'000});
  EXPECT_EQ(engine->lateness().max, 2 * kMillisecond);
  EXPECT_GE(engine->lateness().p50, 100'000) << "that it was later once is forgotten";
}

TEST_F(PulseSlides, ASlowWriteOfOneChannelPutsOffTheStepThatAnotherWaitsFor) {
  make({config(0), config(1)}, 1'000 * kMillisecond);
  follow(cruise(kMillisecond, 0, 100, 1000.0), 0);
  follow(cruise(kMillisecond, 0, 10, 100.0), 1);
  runUntil(51'400'000);
  waitUntil(51'500'000);
  serveSlowly(600'000);
  EXPECT_EQ(engine->state().slipped, 350'000);
  runUntil(57 * kMillisecond);
  EXPECT_EQ(lines.rises(2).back(), 56 * kMillisecond + 350'000);
}

TEST_F(PulseSlides, AStepThatAnotherProfileReplacesPutsNothingOff) {
  make({config(0)});
  const auto first = follow(cruise(kMillisecond, 0, 100, 1000.0));
  follow(cruise(11'200'000, 10, 20, 100.0), 0, first);
  runUntil(10'400'000);
  waitUntil(10'500'000);
  serveSlowly(600'000);  // the first one's next step would be at 11.5 ms
  runOut();
  EXPECT_EQ(engine->state().slips, 0U);
  ASSERT_EQ(lines.rises(0).size(), 20U);
  EXPECT_EQ(lines.rises(0)[10], 16'200'000);
}

TEST_F(PulseSlides, NoStepGoesOutByTheTimeBeforeAnOrderThatSlidIt) {
  make({config(0), config(1)});
  runUntil(500'000);
  Command order;
  order.kind = Command::Kind::kReserve;
  order.channel = 1;
  order.serial = ++serial;
  ASSERT_TRUE(engine->post(order));
  order.kind = Command::Kind::kRelease;
  order.serial = ++serial;
  order.ready = 13 * kMillisecond;
  ASSERT_TRUE(engine->post(order));
  follow(cruise(kMillisecond, 0, 100, 1000.0), 0);
  runUntil(10'400'000);
  waitUntil(10'500'000);
  follow(cruise(10'500'000, 0, -10, 1000.0), 1);  // its first step at 11 ms
  runUntil(14 * kMillisecond);
  EXPECT_EQ(engine->state().slipped, 2 * kMillisecond);
  EXPECT_EQ(lines.rises(0)[9], 12'500'000);
  EXPECT_EQ(lines.rises(2).front(), 13 * kMillisecond);
}

TEST_F(PulseSlides, TheLatenessOfAStepIsItsOwn) {
  make({config(0)}, kMillisecond);
  restart_interval = 2 * kMillisecond;
  follow(cruise(kMillisecond, 0, 10, 1000.0));
  runUntil(5'400'000);
  waitUntil(5'600'000);
  runOut();
  EXPECT_EQ(engine->lateness().max, 100'000);
  EXPECT_EQ(engine->lateness().p50, 0) << "the steps after it were in time";

  follow(cruise(20 * kMillisecond, 10, 20, 1000.0));
  runUntil(25 * kMillisecond);
  waitUntil(28 * kMillisecond);
  runOut();
  ASSERT_EQ(engine->channel(0).end, EndReason::kTooLate);
  follow(cruise(30 * kMillisecond, 15, 20, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->lateness().max, 100'000) << "the pulse that was too late has not gone out";
}

TEST_F(PulseSlides, TheFirstStepOfAMotionMayBeLateByAnyTime) {
  make({config(0)}, kMillisecond);
  restart_interval = 2 * kMillisecond;
  for (const std::int64_t from : {0, 10}) {
    SCOPED_TRACE(from);
    const Nanoseconds motion_now = clock.now() - engine->state().slipped;
    follow(cruise(motion_now + kMillisecond, from, from + 10, 1000.0));
    runUntil(clock.now() + kMillisecond);
    waitUntil(clock.now() + 5 * kMillisecond);
    runOut();
    EXPECT_EQ(engine->channel(0).end, EndReason::kDone) << "though it stood";
  }
  EXPECT_EQ(engine->channel(0).count, 20);
}

TEST_F(PulseSlides, AfterThemOrdersAreInMotionTime) {
  make({config(0)}, 1'000 * kMillisecond);
  follow(cruise(kMillisecond, 0, 2, 1000.0));
  runUntil(kMillisecond);
  waitUntil(11 * kMillisecond);
  runOut();
  const Nanoseconds slipped = engine->state().slipped;
  ASSERT_GT(slipped, 9 * kMillisecond);
  EXPECT_EQ(engine->channel(0).end_time, 3 * kMillisecond) << "motion time";

  const Nanoseconds motion_now = clock.now() - slipped;
  const auto past = follow(cruise(motion_now - 1, 2, 4, 1000.0));
  runOut();
  EXPECT_LT(engine->channel(0).accepted, past);
  const auto in_time = follow(cruise(clock.now() - slipped, 2, 4, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).ended, in_time);
  EXPECT_EQ(engine->channel(0).count, 4);
}

TEST_F(PulseSlides, AMotionThatIsStoppedEndsWithAllThatWereToFollow) {
  make({config(0)});
  restart_interval = 2 * kMillisecond;
  const auto first = follow(cruise(kMillisecond, 0, 100, 1000.0));
  const auto last = follow(cruise(21'200'000, 20, 100, 1000.0), 0, first);
  runUntil(15'100'000);
  engine->emergencyStop();
  runOut();
  EXPECT_EQ(engine->channel(0).ended, last);
  EXPECT_TRUE(engine->channel(0).end_abrupt);
  engine->clearEmergencyStop(engine->stopsServed());
  follow(cruise(30 * kMillisecond, engine->channel(0).count, 20, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_FALSE(engine->channel(0).end_abrupt);
}

TEST_F(PulseSlides, AFallThatFailedMayHaveHappenedAndCountsForTheLowTime) {
  make({config(0)});
  follow(cruise(kMillisecond, 0, 100, 1000.0));
  while (!lines.levels[0]) clock.waitUntil(engine->serve());
  waitUntil(clock.now() + 100'000);
  lines.broken = 0;
  EXPECT_EQ(engine->serve(), kNever) << "it tries again and again";
  ASSERT_EQ(engine->channel(0).end, EndReason::kLineError);
  lines.broken = -1;
  lines.levels[0] = false;  // it had this level before
  const Nanoseconds failed = clock.now();
  follow(cruise(failed, 1, 2, 500'000.0));  // its step comes a microsecond later
  runOut();
  EXPECT_EQ(lines.rises(0).back(), failed + config(0).step_low);
}

TEST_F(PulseSlides, TheBacklashIsTakenUpStepByStepBetweenNoneAndAll) {
  ChannelConfig loose = config(0);
  loose.backlash = 3;
  make({loose});
  follow(cruise(kMillisecond, 0, 2, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).slack, 2);
  follow(cruise(clock.now() + kMillisecond, 2, 6, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).slack, 3);
  follow(cruise(clock.now() + kMillisecond, 6, 1, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).slack, 0);
}

}  // namespace
}  // namespace stepdriver::pulse
