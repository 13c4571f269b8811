#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

/// Channels 0 and 1 share motors: the motor of 0 moves by their sum, that of 1 by their difference.
class SharedMotorsTest : public PulseEngineTest {
 protected:
  void SetUp() override {
    SharedAxes shared;
    shared.channels = {0, 1};
    shared.matrix = {{1.0, 1.0}, {1.0, -1.0}};
    shared.inverse = {{0.5, 0.5}, {0.5, -0.5}};
    engine = std::make_unique<PulseEngine>(
        lines, clock, std::vector<ChannelConfig>{config(0), config(1)}, 5'000'000, std::nullopt,
        std::vector<SharedAxes>{shared});
  }
  std::size_t pulses(int motor) { return lines.rises(motor * kLinesPerChannel).size(); }
};

TEST_F(SharedMotorsTest, ALatePassMakesNoStepOfAProfileThatWasReplacedBeforeIt) {
  const std::uint64_t forward = follow(cruise(1'000'000, 0, 100, 1000.0));
  runUntil(5'000'000);
  follow(cruise(10'000'000, 9, 5, 1000.0), 0, forward);
  runUntil(9'900'000);
  EXPECT_EQ(pulses(0), 9U);
  // Both the tenth step forward and the first one back would be at 10.5 ms.
  while (clock.now() < 10'700'000) clock.waitUntil(10'700'000);
  runOut();
  EXPECT_EQ(engine->channel(0).count, 5);
  EXPECT_EQ(engine->channel(1).count, 0);
  EXPECT_EQ(pulses(0), 13U);
  EXPECT_EQ(pulses(1), 13U);
}

TEST_F(SharedMotorsTest, AnAxisEndsWhileTheOtherContinues) {
  follow(cruise(1'000'000, 0, 10, 1000.0), 0);
  follow(cruise(1'000'000, 0, 30, 1000.0), 1);
  runUntil(12'000'000);
  EXPECT_EQ(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_NE(engine->channel(1).following, 0U);
  runOut();
  EXPECT_EQ(engine->channel(0).count, 10);
  EXPECT_EQ(engine->channel(1).count, 30);
  EXPECT_EQ(engine->channel(0).own, 40);
  EXPECT_EQ(engine->channel(1).own, -20);
  EXPECT_EQ(pulses(0), 40U);
  EXPECT_EQ(pulses(1), 20U);
}

// While x and y move against each other, the motor of their sum stands still. Then only y moves. A
// motion of x that begins later finds the motor's next step from there on, not from its last step
// on, when x wasn't yet at its end.
TEST_F(SharedMotorsTest, AMotionThatBeginsLaterChangesNoStepBeforeIt) {
  follow(cruise(1'000'000, 0, 1, 100.0), 0);
  follow(cruise(1'000'000, 0, -3, 100.0), 1);
  runUntil(12'000'000);
  ASSERT_EQ(engine->channel(0).following, 0U);
  ASSERT_NE(engine->channel(1).following, 0U);
  EXPECT_EQ(pulses(0), 0U);
  follow(cruise(40'000'000, 1, 2, 100.0), 0);
  runOut();
  // Its steps: at -0.5 and -1.5 for y alone, and back at -1.5 for x.
  EXPECT_EQ(lines.rises(0), (std::vector<Nanoseconds>{16'000'000, 26'000'000, 45'000'000}));
  EXPECT_EQ(engine->channel(0).count, 2);
  EXPECT_EQ(engine->channel(1).count, -3);
}

TEST_F(SharedMotorsTest, AProfileThatTakesOverChangesNoStepBeforeIt) {
  follow(cruise(1'000'000, 0, 3, 100.0), 0);
  const std::uint64_t y = follow(cruise(1'000'000, 0, -3, 100.0), 1);
  runUntil(10'000'000);
  EXPECT_EQ(pulses(0), 0U);
  // From 11 ms on y goes back, at the same speed.
  follow(cruise(11'000'000, -1, 1, 100.0), 1, y);
  runOut();
  // x + y is 0 until 11 ms, and then rises by 200 steps/s to 4 at 31 ms.
  EXPECT_EQ(lines.rises(0),
            (std::vector<Nanoseconds>{13'500'000, 18'500'000, 23'500'000, 28'500'000}));
  EXPECT_EQ(engine->channel(0).count, 3);
  EXPECT_EQ(engine->channel(1).count, 1);
}

TEST_F(SharedMotorsTest, NoOrderIsFollowedWhileThePinsOfAChipAreWritten) {
  Command reserve;
  reserve.kind = Command::Kind::kReserve;
  reserve.channel = 1;
  reserve.serial = 1;
  EXPECT_TRUE(engine->post(reserve));
  const std::uint64_t refused = follow(cruise(1'000'000, 0, 10, 1000.0), 0);
  runOut();
  EXPECT_EQ(engine->channel(0).taken, refused);
  EXPECT_EQ(engine->channel(0).accepted, 0U);
  EXPECT_EQ(pulses(0), 0U);
}

}  // namespace
}  // namespace stepdriver::pulse
