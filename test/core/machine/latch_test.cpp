#include <gtest/gtest.h>

#include <algorithm>
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
#include "support/traced_place.h"

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
    // A flag begins with the step to it and ends with the first step beyond it, and a step is made
    // half a step before its place.
    const double ahead = edges[i].active ? -0.5 * kStep : 0.5 * kStep;
    EXPECT_NEAR(edges[i].axes[0].position, place + (up ? ahead : -ahead), 1.1e-10) << i;
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

// An edge comes with a step of x, which is made where x crosses the middle between two counts: that
// place is known exactly. y moves meanwhile, and is known by its steps before and after that time.
TEST_F(LatchTest, IsExactInRandomMotionsWithHoldsOverridesAndStops) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> places(-0.05, 0.05);
  const Latch every = latch(LatchEdge::kEither, true);
  for (int i = 0; i < 60; ++i) {
    axis::Axis& x = bench->axis();
    const axis::Move move = x.moveTo(places(random));
    const axis::Move beside = bench->axis("y").moveTo(places(random));
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
    bench->axis("y").wait(beside);
  }
  // At 0.1 m/s, an axis moves 1e-10 m in the nanosecond to which times are rounded.
  constexpr double kRounding = 1.1e-10 / kStep;
  const std::vector<LatchedEdge> edges = every.record->take();
  const std::vector<std::int64_t> rises = bench->trace->times("x", "flag1", true);
  const std::vector<std::int64_t> falls = bench->trace->times("x", "flag1", false);
  EXPECT_EQ(edges.size(), rises.size() + falls.size());
  EXPECT_GT(edges.size(), 100U);
  const test::TracedMotor x(*bench->trace, "x", 1.02 / kStep, 0.0);
  const test::TracedMotor y(*bench->trace, "y", 1.02 / kStep, 0.0);
  for (const LatchedEdge& edge : edges) {
    const auto& times = edge.active ? rises : falls;
    EXPECT_EQ(std::count(times.begin(), times.end(), edge.time), 1);
    const auto time_ns = static_cast<double>(edge.time);
    EXPECT_EQ(x.at(time_ns).error, 0.0);
    EXPECT_NEAR(edge.axes[0].position / kStep, x.at(time_ns).place, kRounding) << edge.number;
    EXPECT_NEAR(edge.axes[1].position / kStep, y.at(time_ns).place, y.at(time_ns).error + kRounding)
        << edge.number;
  }
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
