#include <gtest/gtest.h>

#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

class StepInputs : public PulseEngineTest {};

TEST_F(StepInputs, OfBothEdgesHalveTheWrites) {
  std::size_t calls[2] = {};
  for (const bool both : {false, true}) {
    ChannelConfig channel = config(0);
    channel.both_edges = both;
    make({channel});
    const std::size_t before = lines.calls;
    follow(cruise(clock.now() + 1'000'000, 0, 1000, 1000.0));
    runOut();
    EXPECT_EQ(engine->channel(0).count, 1000);
    calls[both ? 1 : 0] = lines.calls - before;
  }
  EXPECT_EQ(calls[0], 2001U) << "an edge of DIR, and two for each step";
  EXPECT_EQ(calls[1], 1001U);
}

TEST_F(StepInputs, OfBothEdgesKeepTheTimesBetweenThem) {
  ChannelConfig channel = config(0);  // 1900 ns high, 2100 ns low
  channel.both_edges = true;
  make({channel});
  follow(cruise(1'000'000, 0, 100, 1e6));  // 1 us from step to step: they must wait
  runOut();
  Nanoseconds last = 0;
  std::size_t edges = 0;
  for (const Edge& edge : lines.edges) {
    if (edge.line != channel.step.line) continue;
    const Nanoseconds least = edges++ == 0 ? 0 : edge.level ? 2'100 : 1'900;
    EXPECT_GE(edge.time - last, least) << edges;
    last = edge.time;
  }
  EXPECT_EQ(edges, 100U);
  EXPECT_EQ(engine->channel(0).count, 100);
}

TEST_F(StepInputs, OfBothEdgesLeaveNoPulseToEndAfterAnEmergencyStop) {
  ChannelConfig channel = config(0);
  channel.both_edges = true;
  make({channel});
  follow(cruise(1'000'000, 0, 100, 1000.0));
  runUntil(21'700'000);
  const std::int64_t count = engine->channel(0).count;
  EXPECT_TRUE(lines.levels[channel.step.line]) << "an odd number of steps";
  engine->emergencyStop();
  engine->serve();
  EXPECT_EQ(engine->stopsServed(), 1U);
  EXPECT_EQ(engine->channel(0).count, count);
  EXPECT_TRUE(lines.levels[channel.step.line]) << "no further edge: it would be a step";
}

TEST_F(StepInputs, ThatAreCwAndCcwNeverPulseBothLinesAtOnce) {
  ChannelConfig channel = config(0);
  channel.dir_steps = true;
  channel.dir_hold = 0;
  lines.write_cost = 300;
  make({channel});
  follow(cruise(1'000'000, 0, 10, 100'000.0));
  runOut();
  follow(cruise(clock.now() + 1'000, 10, -10, 100'000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).count, -10);
  EXPECT_EQ(lines.rises(channel.step.line).size(), 10U);
  EXPECT_EQ(lines.rises(channel.dir.line).size(), 20U);
  int high = 0;
  Nanoseconds fell = 0;
  for (const Edge& edge : lines.edges) {
    high += edge.level ? 1 : -1;
    EXPECT_LE(high, 1);
    const bool turned = edge.line == channel.dir.line && fell != 0;
    EXPECT_GE(edge.time - fell, edge.level && turned ? channel.dir_setup : 0);
    if (!edge.level) fell = edge.line == channel.step.line ? edge.time : 0;
  }
}

}  // namespace
}  // namespace stepdriver::pulse
