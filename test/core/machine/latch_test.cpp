#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/refusal.h"

// Positions latched at edges of an input, on the rig: 80 steps/mm.

namespace stepdriver {
namespace {

using machine::Latch;
using machine::LatchedEdge;
using machine::LatchEdge;
using machine::LatchRequest;
using machine::LatchResult;
using test::Bench;
using test::kStep;
using test::linearAxis;

/// Two axes; the carriage of x passes flags of 1 mm, every 5 mm.
class LatchTest : public testing::Test {
 protected:
  void SetUp() override { build(linearAxis("x")); }

  void build(const config::AxisConfig& x, std::int64_t debounce_ns = 0, int bounces = 0) {
    const std::vector<config::AxisConfig> axes{x, linearAxis("y")};
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    sim::SwitchSpec flag;
    flag.line = "io.flag";
    flag.active_level = true;
    flag.position = 2.0;
    flag.end = 3.0;
    flag.every = 5.0;
    flag.bounces = bounces;
    flag.bounce_ns = 100'000;
    specs[0].flags.push_back(flag);
    machine::MachineOptions options;
    config::InputConfig input;
    input.name = "flag";
    input.line = {"io.flag", true, Bias::kAsIs};
    input.debounce_ns = debounce_ns;
    options.inputs.push_back(input);
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, options);
    for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  }

  Latch latch(LatchEdge edge = LatchEdge::kActive, bool every = false) {
    LatchRequest request;
    request.input = "flag";
    request.edge = edge;
    request.every = every;
    return bench->machine->latch(request);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(LatchTest, KnowsAllAxesAtTheEdgeWhateverComesAfterIt) {
  const Latch first = latch();
  bench->axis("x").moveTo(0.01);
  bench->axis("y").moveTo(-0.02);
  const LatchResult result = bench->machine->wait(first);
  ASSERT_TRUE(result.latched) << result.message;
  EXPECT_EQ(result.edges, 1U);
  EXPECT_TRUE(result.edge->active);
  ASSERT_EQ(result.edge->axes.size(), 2U);
  // The step to 2 mm was made when the curve crossed the half step before it.
  EXPECT_NEAR(result.edge->axes[0].position, 0.002 - 0.5 * kStep, 1e-8);
  // y began at the same nanosecond, or a millisecond later: 0.5 a t^2 at the same time.
  EXPECT_LT(result.edge->axes[1].position, -0.001);
  EXPECT_EQ(result.edge->axes[1].name, "y");
  EXPECT_TRUE(result.edge->axes[1].position_valid);
  EXPECT_EQ(result.edge->time, bench->trace->times("x", "flag1", true).front());
}

TEST_F(LatchTest, TakesEveryEdgeOfAMotionWithItsNumber) {
  const Latch every = latch(LatchEdge::kEither, true);
  bench->move(0.05);
  bench->move(0.0);
  const std::vector<LatchedEdge> edges = every.record->take();
  ASSERT_EQ(edges.size(), 40U);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    EXPECT_EQ(edges[i].number, i + 1);
    EXPECT_EQ(edges[i].active, i % 2 == 0);
    const bool up = i < 20;
    const double way = static_cast<double>(up ? i : 39 - i);
    const double place = 0.002 + 0.005 * std::floor(way / 2) + 0.001 * std::fmod(way, 2.0);
    // A flag ends at the first step beyond it.
    EXPECT_NEAR(edges[i].axes[0].position, place, 1.01 * kStep) << i;
  }
  bench->machine->end(every);
  const LatchResult result = bench->machine->wait(every);
  EXPECT_EQ(result.message, "the latch has ended after 40 edges: it was ended");
  EXPECT_TRUE(result.latched);
}

TEST_F(LatchTest, HasThePositionOfTheFirstContactIfTheInputBounces) {
  build(linearAxis("x"), 2'000'000, 4);
  const Latch first = latch();
  bench->axis("x").moveTo(0.02);
  const LatchResult result = bench->machine->wait(first);
  ASSERT_TRUE(result.latched);
  EXPECT_NEAR(result.edge->axes[0].position, 0.002 - 0.5 * kStep, 1e-8);
}

TEST_F(LatchTest, IsExactInRandomMotionsWithHoldsOverridesAndStops) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> places(-0.05, 0.05);
  const Latch every = latch(LatchEdge::kEither, true);
  std::size_t seen = 0;
  for (int i = 0; i < 60; ++i) {
    axis::Axis& x = bench->axis();
    const axis::Move move = x.moveTo(places(random));
    bench->machine->advance(0.05 + 0.3 * std::abs(places(random)) * 20.0);
    switch (i % 4) {
      case 0:
        bench->machine->hold();
        bench->machine->advance(0.3);
        bench->machine->resume();
        break;
      case 1:
        bench->machine->setSpeedOverride(i % 8 == 1 ? 0.5 : 1.0);
        break;
      case 2:
        x.stop();
        break;
      default:
        break;
    }
    x.wait(move);
    for (const LatchedEdge& edge : every.record->take()) {
      ++seen;
      // Each edge is at a border of a flag, to a step.
      const double in = std::remainder(edge.axes[0].position - 0.0025, 0.005);
      EXPECT_NEAR(std::abs(in), 0.0005, 1.01 * kStep) << i;
    }
  }
  EXPECT_GT(seen, 100U);
}

TEST_F(LatchTest, CountsOnlyEdgesWithinItsWindow) {
  LatchRequest request;
  request.input = "flag";
  request.axes = {"y"};
  request.window = machine::LatchWindow{"x", 0.01, 0.02};
  const Latch first = bench->machine->latch(request);
  bench->move(0.03);
  const LatchResult result = bench->machine->wait(first);
  ASSERT_EQ(result.edge->axes.size(), 1U);
  EXPECT_EQ(result.edge->axes[0].name, "y");
  EXPECT_EQ(result.edge->time, bench->trace->times("x", "flag1", true).at(2));
}

TEST_F(LatchTest, EndsWithTheMachineAndWhenItsCallerNoLongerWaits) {
  const Latch first = latch();
  EXPECT_FALSE(bench->machine->wait(first, [] { return true; }).latched);
  const Latch second = latch();
  bench->machine->shutdown();
  const LatchResult result = bench->machine->wait(second);
  EXPECT_FALSE(result.latched);
  EXPECT_EQ(result.message, "the latch has ended after 0 edges: the machine was shut down");
}

TEST_F(LatchTest, RefusesWhatThereIsNot) {
  LatchRequest request;
  request.input = "probe";
  EXPECT_REFUSED(bench->machine->latch(request), "there is no input probe (inputs: flag)");
  request.input = "flag";
  request.axes = {"z"};
  EXPECT_REFUSED(bench->machine->latch(request), "there is no axis z");
  request.axes.clear();
  request.window = machine::LatchWindow{"x", 1.0, 0.0};
  EXPECT_REFUSED(bench->machine->latch(request), "from a lower position to a higher one");
}

}  // namespace
}  // namespace stepdriver
