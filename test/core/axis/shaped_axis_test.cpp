#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "motion/planner.h"
#include "motion/shaped_profile.h"
#include "motor/input_shaping.h"
#include "sim/spring_mass.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/coordinated_move.h"
#include "support/bench.h"
#include "support/corexy_bench.h"
#include "support/motion_trace.h"

// Axes whose motions are shaped, by the edges on the rig's lines. The frame that they pull along by
// a spring is computed from the edges.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr double kFrequency = 20.0;
constexpr double kDamping = 0.05;
constexpr double kScale = 400'000.0;  // steps/m
constexpr std::int64_t kSecond = 1'000'000'000;

/// 100,000 steps/s within 13 ms.
config::AxisConfig plain(const std::string& name = "x") {
  config::AxisConfig config = linearAxis(name, kScale, 0.25, 20.0);
  config.stop_deceleration = 25.0;
  return config;
}

config::AxisConfig shaped(const std::string& name = "x",
                          config::ShaperType type = config::ShaperType::kZv) {
  config::AxisConfig config = plain(name);
  config.input_shaper = {{type, kFrequency, kDamping}};
  return config;
}

double shaperTime() { return motor::shapingTimeOf(shaped()); }

/// [steps] How a mass that the axis pulls along rings at a time after all edges.
double ringing(Bench& bench, std::int64_t at, const std::string& name = "x",
               double frequency = kFrequency) {
  sim::SpringMass mass(frequency, kDamping, 0.0);
  const sim::MemoryTrace& trace = *bench.trace;
  const int step = trace.pin(name, "step");
  const int dir = trace.pin(name, "dir");
  bool forward = trace.levels()[static_cast<std::size_t>(dir)];
  double count = 0.0;
  for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
    if (edge.pin == dir) forward = edge.level;
    if (edge.pin != step || !edge.level || edge.time_ns > at) continue;
    count += forward ? 1.0 : -1.0;
    mass.moveTo(count, edge.time_ns);
  }
  return mass.ringing(at);
}

/// The clock time of the last pulse.
std::int64_t lastPulse(Bench& bench, const std::string& name = "x") {
  const int step = bench.trace->pin(name, "step");
  std::int64_t last = 0;
  for (const sim::MemoryTrace::Edge& edge : bench.trace->edges()) {
    if (edge.pin == step && edge.level) last = edge.time_ns;
  }
  return last;
}

void rest(Bench& bench, const std::string& name = "x") {
  while (bench.axis(name).state().moving) bench.machine->advance(1e-4);
}

void expectClean(Bench& bench, const std::string& name = "x") {
  EXPECT_EQ(violationsOf(bench.report(name)), "");
  EXPECT_EQ(bench.machine->figures().slips, 0U);
  const double count = bench.axis(name).state().position * kScale;
  EXPECT_NEAR(static_cast<double>(bench.pulses(name)), count, 1e-6);
}

TEST(ShapedAxis, EachEdgeIsWhereTheShapedCurveCrossesItsLine) {
  Bench bench({shaped("x", config::ShaperType::kEi)});
  const axis::Move move = bench.axis().moveTo(0.05);
  const motion::Profile plan =
      motion::planMove(0, {}, 20'000, {0.0, 0.25 * kScale, 20.0 * kScale, 20.0 * kScale, 0.0})
          .profile;
  const auto shaper = motor::inputShaperOf(shaped("x", config::ShaperType::kEi));
  EXPECT_NEAR(move.duration, (static_cast<double>(plan.endNs() + shaper->durationNs())) * 1e-9,
              1e-9);
  const axis::MoveResult result = bench.axis().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_NEAR(result.duration, move.duration, 1e-8);
  expectClean(bench);
  EXPECT_EQ(bench.pulses(), 20'000);
  const motion::ShapedProfile made(plan, *shaper, 0);
  const int step = bench.trace->pin("x", "step");
  std::optional<std::int64_t> start;
  double line = 0.5;
  for (const sim::MemoryTrace::Edge& edge : bench.trace->edges()) {
    if (edge.pin != step || !edge.level) continue;
    if (!start) {
      // Found by bisection: the time at which the curve crosses the first line.
      std::int64_t low = 0;
      std::int64_t high = made.endNs();
      while (high - low > 1) {
        const std::int64_t mid = low + (high - low) / 2;
        (made.stateAt(mid).position.value() < line ? low : high) = mid;
      }
      start = edge.time_ns - high;
    }
    const std::int64_t t = edge.time_ns - *start;
    ASSERT_LT(made.stateAt(t - 3).position.value(), line);
    ASSERT_GT(made.stateAt(t + 3).position.value(), line);
    line += 1.0;
  }
}

TEST(ShapedAxis, WhatItPullsDoesNotRing) {
  const auto after_move = [](const config::AxisConfig& config, double frequency) {
    Bench bench({config});
    const double later = config.input_shaper.empty() ? shaperTime() : 0.0;
    const double way = 0.25 * 2.5 / kFrequency;
    const axis::MoveResult result = bench.move(way);
    EXPECT_EQ(result.end, MoveEnd::kReached);
    expectClean(bench);
    return ringing(bench, bench.clock.now() + std::llround(later * 1e9), "x", frequency);
  };
  const double without = after_move(plain(), kFrequency);
  EXPECT_GT(without, 500.0);
  EXPECT_LE(after_move(shaped("x", config::ShaperType::kZv), kFrequency), 0.01 * without);
  EXPECT_LE(after_move(shaped("x", config::ShaperType::kMzv), kFrequency), 0.01 * without);
  for (const double of : {0.9, 1.0, 1.1}) {
    const double beside = after_move(plain(), of * kFrequency);
    EXPECT_LE(after_move(shaped("x", config::ShaperType::kEi), of * kFrequency), 0.05 * beside);
    EXPECT_LE(after_move(shaped("x", config::ShaperType::kTwoHumpEi), of * kFrequency),
              0.05 * beside);
  }
}

TEST(ShapedAxis, AStopIsShapedToo) {
  const auto after_stop = [](const config::AxisConfig& config) {
    Bench bench({config});
    const axis::Move move = bench.axis().moveTo(0.05);
    bench.machine->advance(0.2 * 0.5);
    bench.axis().stop();
    const std::int64_t stopped = bench.clock.now();
    EXPECT_EQ(bench.axis().wait(move).end, MoveEnd::kStopped);
    expectClean(bench);
    const double longest =
        0.001 + 0.25 / 25.0 + (config.input_shaper.empty() ? 0.0 : motor::shapingTimeOf(config));
    EXPECT_LE(lastPulse(bench), stopped + std::llround(longest * 1e9));
    EXPECT_GT(lastPulse(bench), stopped + std::llround(0.8 * longest * 1e9));
    return ringing(bench, stopped + kSecond / 10);
  };
  const double without = after_stop(plain());
  EXPECT_GT(without, 150.0);
  EXPECT_LE(after_stop(shaped()), 0.01 * without);
}

TEST(ShapedAxis, ATakeoverDuringAMotionKeepsWhatIsStillToBeMade) {
  const auto after_two = [](const config::AxisConfig& config) {
    Bench bench({config});
    const axis::Move first = bench.axis().moveTo(0.05);
    bench.machine->advance(0.04);
    bench.machine->setSpeedOverride(0.5);
    bench.machine->advance(0.011);
    bench.machine->setSpeedOverride(1.0);
    bench.machine->advance(0.013);
    const axis::Move second = bench.axis().moveTo(-0.01);
    EXPECT_EQ(bench.axis().wait(first).end, MoveEnd::kReplaced);
    EXPECT_EQ(bench.axis().wait(second).end, MoveEnd::kReached);
    expectClean(bench);
    EXPECT_EQ(bench.pulses(), -4'000);
    return ringing(bench, bench.clock.now());
  };
  EXPECT_GT(after_two(plain()), 100.0);
  EXPECT_LE(after_two(shaped()), 3.0);
}

TEST(ShapedAxis, ItRestsWhenItsLastPartIsMade) {
  Bench bench({shaped()});
  const axis::Move move = bench.axis().moveTo(0.002);
  bench.machine->advance(move.duration - shaperTime() + 0.002);
  // The plan has come to its end, the motor hasn't.
  EXPECT_TRUE(bench.axis().state().moving);
  EXPECT_NEAR(bench.axis().state().time_left, shaperTime() - 0.001, 1e-4);
  EXPECT_EQ(bench.axis().state().target, 0.002);
  EXPECT_LT(bench.axis().state().position, 0.0015);
  // A stop has nothing left to change.
  bench.axis().stop();
  const axis::MoveResult result = bench.axis().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped);
  EXPECT_NEAR(result.duration, move.duration, 1e-8);
  EXPECT_EQ(bench.pulses(), 800);
  expectClean(bench);
}

TEST(ShapedAxis, AHoldAndItsResumeAreShaped) {
  Bench bench({shaped()});
  const axis::Move move = bench.axis().moveTo(0.05);
  bench.machine->advance(0.08);
  bench.machine->hold();
  bench.machine->advance(0.1);
  EXPECT_FALSE(bench.axis().state().moving);
  EXPECT_LE(ringing(bench, bench.clock.now()), 8.0);
  bench.machine->resume();
  EXPECT_EQ(bench.axis().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 20'000);
  EXPECT_LE(ringing(bench, bench.clock.now()), 8.0);
  expectClean(bench);
}

TEST(ShapedAxis, AnEmergencyStopEndsItAtOnceAndNothingIsMadeLater) {
  Bench bench({shaped()});
  bench.axis().moveTo(0.05);
  bench.machine->advance(0.08);
  bench.machine->emergencyStop();
  const std::int64_t stopped = bench.clock.now();
  bench.machine->advance(0.5);
  EXPECT_LE(lastPulse(bench), stopped);
  const std::int64_t count = bench.pulses();
  bench.machine->recover();
  const axis::MoveResult back = bench.move(0.0);
  EXPECT_EQ(back.end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_GT(count, 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(ShapedAxis, AnEndstopEndsItAtOnce) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({shaped()});
  rig[0].max_switch->position = 10.0;
  Bench bench({shaped()}, rig);
  EXPECT_EQ(bench.move(0.05).end, MoveEnd::kEndstopMax);
  const std::int64_t last = lastPulse(bench);
  EXPECT_NEAR(bench.axis().state().position, 0.01, 2.0 / kScale);
  bench.machine->advance(0.5);
  EXPECT_EQ(lastPulse(bench), last);
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  expectClean(bench);
}

TEST(ShapedAxis, AJogStaysWithinTheSoftLimits) {
  config::AxisConfig config = shaped();
  config.max_position = 0.03;
  Bench bench({config});
  bench.axis().jog(0.2);
  rest(bench);
  EXPECT_NEAR(bench.axis().state().position, 0.03, 1e-9);
  EXPECT_LE(ringing(bench, bench.clock.now()), 8.0);
  bench.axis().jog(-0.2);
  bench.machine->advance(0.05);
  bench.axis().jog(0.0);
  rest(bench);
  EXPECT_LE(ringing(bench, bench.clock.now()), 8.0);
  expectClean(bench);
}

TEST(ShapedAxis, AHomingFindsTheSwitchAsExactly) {
  config::AxisConfig config = shaped();
  config::HomingConfig homing;
  homing.seek_speed = 0.1;
  homing.latch_speed = 0.005;
  homing.pull_off = 0.003;
  homing.max_travel = 0.2;
  config.homing = homing;
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({config});
  rig[0].min_switch->position = -7.0;
  Bench bench({config}, rig);
  const axis::HomingResult result = bench.axis().home();
  EXPECT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
  // The trigger point is 0, which is at -7 mm of the rig.
  EXPECT_NEAR(bench.report().carriage + 7.0, 1000.0 * bench.axis().state().position,
              1000.0 * 1.01 / kScale);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(ShapedAxis, ALineOfAxesWithTheSameShaperStaysStraight) {
  Bench bench({shaped("x"), shaped("y")});
  machine::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.03, 0.02};
  const auto move = bench.machine->moveLine(line);
  bench.machine->wait(move);
  EXPECT_EQ(bench.pulses("x"), 12'000);
  EXPECT_EQ(bench.pulses("y"), 8'000);
  const test::MotionTrace trace(bench);
  const auto x = trace.steps("x");
  std::size_t i = 0;
  for (const auto& step : trace.steps("y")) {
    while (i < x.size() && x[i].time < step.time) ++i;
    const double at_x = i < x.size() ? static_cast<double>(x[i].count) - 0.5 : 12'000.0;
    EXPECT_NEAR(static_cast<double>(step.count) - 0.5, at_x * 2.0 / 3.0, 1.0);
  }
  EXPECT_LE(ringing(bench, bench.clock.now(), "x"), 8.0);
  EXPECT_LE(ringing(bench, bench.clock.now(), "y"), 8.0);
  expectClean(bench, "x");
  expectClean(bench, "y");
}

TEST(ShapedAxis, AxesThatShareMotorsAreShapedOneByOne) {
  std::vector<config::AxisConfig> axes{shaped("x"), plain("y")};
  axes[0].max_speed = axes[1].max_speed = 0.1;
  test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
  Bench bench(axes);
  const axis::Move x = bench.axis("x").moveTo(0.02);
  bench.machine->advance(0.05);
  const axis::Move y = bench.axis("y").moveTo(-0.01);
  EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kReached);
  EXPECT_EQ(bench.axis("x").wait(x).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 4'000);
  EXPECT_EQ(bench.pulses("y"), 12'000);
  EXPECT_NEAR(bench.report("x").carriage, 20.0, 1e-6);
  EXPECT_NEAR(bench.report("y").carriage, -10.0, 1e-6);
  EXPECT_EQ(violationsOf(bench.report("x")), "");
}

}  // namespace
}  // namespace stepdriver
