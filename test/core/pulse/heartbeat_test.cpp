#include "pulse/heartbeat.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <vector>

#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

constexpr int kOutput = 40;
constexpr Nanoseconds kInterval = 5'000'000;

class HeartbeatTest : public PulseEngineTest {
 protected:
  void SetUp() override {
    make({config(0), config(1)});
    engine->beat({kOutput, kInterval});
  }

  std::vector<Nanoseconds> beats() const {
    std::vector<Nanoseconds> times;
    for (const Edge& edge : lines.edges) {
      if (edge.line == kOutput) times.push_back(edge.time);
    }
    return times;
  }
};

TEST_F(HeartbeatTest, ChangesItsLineAtAFixedRateAtRest) {
  runUntil(23'000'000);
  EXPECT_EQ(beats(), (std::vector<Nanoseconds>{0, 5'000'000, 10'000'000, 15'000'000, 20'000'000}));
  EXPECT_TRUE(lines.edges.front().level) << "it was low";
}

TEST_F(HeartbeatTest, NeitherDelaysStepsNorIsDelayedByThem) {
  follow(cruise(1'000'000, 0, 100, 1000.0));
  runUntil(120'000'000);
  EXPECT_EQ(engine->channel(0).count, 100);
  EXPECT_EQ(engine->state().worst_lateness, 0);
  EXPECT_EQ(beats().size(), 25U);
  for (std::size_t i = 0; i < beats().size(); ++i) {
    EXPECT_EQ(beats()[i], static_cast<Nanoseconds>(i) * kInterval);
  }
}

TEST_F(HeartbeatTest, DoesNotMakeUpWhatItMissed) {
  runUntil(11'000'000);
  clock.waitUntil(61'000'000);  // stopped meanwhile
  runUntil(77'000'000);
  EXPECT_EQ(beats(), (std::vector<Nanoseconds>{0, 5'000'000, 10'000'000, 61'000'000, 66'000'000,
                                               71'000'000, 76'000'000}));
}

TEST_F(HeartbeatTest, GoesOnInAnEmergencyStop) {
  runUntil(11'000'000);
  engine->emergencyStop();
  runUntil(22'000'000);
  EXPECT_EQ(beats().size(), 5U);
}

TEST_F(HeartbeatTest, ThatCantBeWrittenIsAFailureOfEveryChannelOnce) {
  follow(cruise(1'000'000, 0, 100, 1000.0));
  runUntil(21'000'000);
  lines.broken = kOutput;
  runUntil(60'000'000);
  for (const int channel : {0, 1}) {
    EXPECT_EQ(engine->channel(channel).line_errors, 1U);
    EXPECT_EQ(engine->channel(channel).failure.line, kOutput);
    EXPECT_EQ(engine->channel(channel).failure.error, ENODEV);
  }
  EXPECT_EQ(engine->channel(0).end, EndReason::kLineError);
  EXPECT_EQ(engine->channel(0).count, 24);
  lines.broken = -1;
  runUntil(80'000'000);
  lines.broken = kOutput;
  runUntil(100'000'000);
  EXPECT_EQ(engine->channel(1).line_errors, 2U) << "it had worked again";
}

}  // namespace
}  // namespace stepdriver::pulse
