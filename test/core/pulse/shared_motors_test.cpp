#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
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
  /// From position 0 on. @param legs [s] and [steps/s], one after the other.
  static motion::Profile profileOf(Nanoseconds start,
                                   const std::vector<std::pair<double, double>>& legs) {
    std::vector<motion::Piece> pieces;
    double position = 0.0;
    for (const auto& [duration, speed] : legs) {
      pieces.push_back({motion::DoubleDouble(duration), motion::DoubleDouble(position), speed});
      position += duration * speed;
    }
    return motion::Profile(start, std::move(pieces));
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

// x and y move against each other, there and back, so that the motor of their sum stands still. The
// motion of one alone would have turned it.
TEST_F(SharedMotorsTest, AMotionThatBeginsLaterMakesNoStepBeforeIt) {
  follow(profileOf(1'000'000, {{0.01, -100.0}, {0.01, 100.0}}), 0);
  follow(profileOf(1'000'000, {{0.01, 100.0}, {0.01, -100.0}, {0.03, -100.0}}), 1);
  runUntil(22'000'000);
  ASSERT_EQ(engine->channel(0).following, 0U);
  ASSERT_NE(engine->channel(1).following, 0U);
  EXPECT_EQ(pulses(0), 0U);
  follow(cruise(60'000'000, 0, 1, 100.0), 0);
  runOut();
  // y alone from 21 ms on, to -3, and then x.
  EXPECT_EQ(lines.rises(0),
            (std::vector<Nanoseconds>{26'000'000, 36'000'000, 46'000'000, 65'000'000}));
  EXPECT_EQ(engine->channel(0).count, 1);
  EXPECT_EQ(engine->channel(1).count, -3);
}

TEST_F(SharedMotorsTest, AProfileThatTakesOverMakesNoStepBeforeIt) {
  follow(profileOf(1'000'000, {{0.01, -100.0}, {0.01, 100.0}, {0.02, 100.0}}), 0);
  const std::uint64_t y =
      follow(profileOf(1'000'000, {{0.01, 100.0}, {0.01, -100.0}, {0.02, -100.0}}), 1);
  runUntil(10'000'000);
  // From 21 ms on both move forward.
  follow(profileOf(21'000'000, {{0.02, 100.0}}), 1, y);
  runOut();
  EXPECT_EQ(lines.rises(0),
            (std::vector<Nanoseconds>{23'500'000, 28'500'000, 33'500'000, 38'500'000}));
  EXPECT_EQ(engine->channel(0).count, 2);
  EXPECT_EQ(engine->channel(1).count, 2);
}

TEST_F(SharedMotorsTest, ADelayInAPulseOfAFastMotorIsAFault) {
  restart_interval = 2'000'000;
  follow(cruise(1'000'000, 0, 100, 1000.0), 0);
  runUntil(50'000'000);
  Nanoseconds due = engine->serve();
  while (!lines.levels[0]) {
    clock.waitUntil(due);
    due = engine->serve();
  }
  const std::size_t before = pulses(0);
  clock.waitUntil(clock.now() + 50'000'000);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kTooLate);
  EXPECT_EQ(pulses(0), before);
  EXPECT_EQ(pulses(1), before);
}

// The motor of their sum stands still for a second, in which the other one is late now and then.
TEST_F(SharedMotorsTest, ManyDelaysTogetherAreNoDelayOfAMotorThatStoodStill) {
  restart_interval = 2'000'000;
  follow(profileOf(1'000'000, {{0.02, 1000.0}, {1.0, 1000.0}, {0.02, 1000.0}}), 0);
  follow(profileOf(1'000'000, {{0.02, 0.0}, {1.0, -1000.0}, {0.02, 0.0}}), 1);
  for (int i = 1; i <= 10; ++i) {
    runUntil(i * 80'000'000);
    clock.waitUntil(clock.now() + 2'000'000);
  }
  EXPECT_GT(engine->state().slipped, 5'000'000);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(1).end, EndReason::kDone);
  EXPECT_EQ(pulses(0), 40U);
  EXPECT_EQ(pulses(1), 2040U);
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
