#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

class PulseGroups : public PulseEngineTest {
 protected:
  void order(motion::Profile profile, int channel, std::uint64_t continues = 0) {
    profiles.push_back(std::make_unique<motion::Profile>(std::move(profile)));
    follows.push_back({channel, ++serial, profiles.back().get(), continues, 2'000'000, 7});
  }
};

TEST_F(PulseGroups, TakesAllProfilesOfAnOrderOrNone) {
  make({config(0), config(1)});
  order(cruise(1'000'000, 0, 100, 1000.0), 0);
  order(cruise(1'000'000, 0, 100, 1000.0), 1, 99);  // continues a profile that doesn't exist
  std::swap(follows[0], follows[1]);
  postFollows(2);
  runOut();
  for (const int channel : {0, 1}) {
    EXPECT_EQ(engine->channel(channel).following, 0U);
    EXPECT_NE(engine->channel(channel).taken, 0U);
    EXPECT_EQ(engine->channel(channel).accepted, 0U);
  }
  EXPECT_TRUE(lines.edges.empty());
}

TEST_F(PulseGroups, EndsAllWhereOneLineFailsWithTheStepsOfThatInstantCounted) {
  make({config(0), config(1), config(2)});
  for (const int channel : {0, 1, 2}) order(cruise(1'000'000, 0, 100, 1000.0), channel);
  follows[2].group = 8;
  postFollows(3);
  runUntil(50'300'000);
  lines.broken = 0;
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kLineError);
  EXPECT_EQ(engine->channel(1).end, EndReason::kCompanion);
  EXPECT_TRUE(engine->channel(1).end_abrupt);
  EXPECT_EQ(engine->channel(2).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(2).count, 100);
  for (const int channel : {0, 1}) {
    const auto sent = lines.rises(channel * kLinesPerChannel).size();
    EXPECT_EQ(engine->channel(channel).count, static_cast<std::int64_t>(sent)) << channel;
    EXPECT_LT(sent, 60U) << channel;
  }
}

TEST_F(PulseGroups, SendsNoStepOfTheInstantAtWhichAnotherMeetsItsEndstop) {
  // Both orders: the channel that meets its endstop is served before the other one, or after it.
  for (const int meets : {0, 1}) {
    SCOPED_TRACE(meets);
    lines.inputs[0] = 0;
    std::vector<ChannelConfig> both{config(0), config(1)};
    both[static_cast<std::size_t>(meets)].endstop_max = Signal{0, true};
    make(both);
    const Nanoseconds start = clock.now() + 1'000'000;
    for (const int channel : {0, 1}) order(cruise(start, 0, 100, 1000.0), channel);
    postFollows(2);
    runUntil(start + 50'300'000);
    const std::int64_t before = engine->channel(0).count;
    lines.inputs[0] = 1;
    runOut();
    EXPECT_EQ(engine->channel(meets).end, EndReason::kEndstopMax);
    EXPECT_EQ(engine->channel(1 - meets).end, EndReason::kCompanion);
    EXPECT_EQ(engine->channel(0).count, before);
    EXPECT_EQ(engine->channel(1).count, before);
  }
}

}  // namespace
}  // namespace stepdriver::pulse
