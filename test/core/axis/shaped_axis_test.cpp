#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "motor/input_shaping.h"
#include "point_to_point/planner.h"
#include "profile/shaped_profile.h"
#include "sim/spring_mass.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/differences.h"
#include "support/gantry_bench.h"
#include "support/motion_trace.h"

// Axes whose motions are shaped, by the edges on the rig's lines. The frame that they pull along by
// a spring is computed from the edges.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::kSecond;
using test::linearAxis;
using test::violationsOf;

constexpr double kFrequency = 20.0;
constexpr double kDamping = 0.05;
constexpr double kScale = 400'000.0;  // steps/m

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
  motion::LineRequest line;
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

// ---- several axes, streams ----

using machine::CoordinatedMove;
using machine::SetpointMode;
using motion::PathRequest;
using motion::PathSegment;
using motion::TrajectoryRequest;
using Together = std::function<CoordinatedMove(machine::Machine&)>;

std::vector<Together> motionsOfTwoAxes() {
  const auto follow = [](const TrajectoryRequest& request) {
    return [request](machine::Machine& machine) { return machine.followTrajectory(request); };
  };
  TrajectoryRequest later{{"x", "y"}, {{0.3, {0.01, 0.02}, {0.0, 0.0}, {}}}};
  later.begin_in = 0.2;
  PathRequest path{{"x", "y"}, {}, false, 0.0, 0.001};
  path.segments.resize(2);
  path.segments[0].end = {0.02, 0.0};
  path.segments[1].end = {0.02, 0.01};
  return {
      [](machine::Machine& machine) {
        return machine.moveLine({{"x", "y"}, {0.02, 0.01}});
      },
      follow({{"x", "y"}, {{0.5, {0.02, 0.01}, {}, {}}}}),
      follow({{"x", "y"}, {{0.3, {0.02, 0.01}, {}, {}}, {0.6, {0.01, 0.0}, {}, {}}}}),
      follow({{"x", "y"}, {{0.3, {0.01, 0.02}, {0.0, 0.0}, {}}}}),
      follow(later),
      [path](machine::Machine& machine) { return machine.followPath(path); },
  };
}

TEST(ShapedAxis, WhatSeveralAxesDoIsAnnouncedWithTheTimeOfTheShaper) {
  for (const Together& begin : motionsOfTwoAxes()) {
    Bench as_planned({plain("x"), plain("y")});
    const double planned = begin(*as_planned.machine).duration;
    Bench bench({shaped("x"), plain("y")});
    const CoordinatedMove move = begin(*bench.machine);
    EXPECT_NEAR(move.duration, planned + shaperTime(), 1e-9);
    const std::int64_t begun = bench.clock.now();
    const machine::CoordinatedResult result = bench.machine->wait(move);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    EXPECT_NEAR(result.duration, move.duration, 1e-8);
    EXPECT_LE(lastPulse(bench), begun + std::llround((0.3 + move.duration) * 1e9));
    expectClean(bench);
  }
}

// Fed at 100 Hz: a ramp that ends after two and a half oscillations.
void streamRamp(Bench& bench, SetpointMode mode) {
  for (int i = 1; i <= 30; ++i) {
    const double t = std::min(0.01 * i, 0.13);
    const double value = mode == SetpointMode::kPosition ? 0.2 * t : (0.01 * i < 0.13 ? 0.2 : 0.0);
    const auto refusals = bench.machine->followSetpoints(mode, 0.1, {{"x", value, {}}});
    EXPECT_EQ(refusals.front(), "");
    bench.machine->advance(0.01);
  }
}

TEST(ShapedAxis, AStreamOfSetpointsIsShapedAndKeepsTheLimits) {
  for (const SetpointMode mode : {SetpointMode::kPosition, SetpointMode::kVelocity}) {
    const auto after_stream = [mode](const config::AxisConfig& config) {
      Bench bench({config});
      streamRamp(bench, mode);
      expectClean(bench);
      EXPECT_FALSE(bench.axis().state().moving);
      std::vector<test::Crossing> crossings;
      std::int64_t before = 0;
      for (const auto& step : test::MotionTrace(bench).steps("x")) {
        crossings.push_back(
            {std::llround(step.time * 1e9), static_cast<double>(before + step.count) / 2.0});
        before = step.count;
      }
      const test::Differences found = test::differencesOf(crossings, 0.004);
      EXPECT_LE(found.speed, 0.25 * kScale * 1.001);
      EXPECT_LE(found.acceleration, 25.0 * kScale * 1.01);
      return ringing(bench, bench.clock.now());
    };
    const double without = after_stream(plain());
    EXPECT_GT(without, 100.0);
    EXPECT_LE(after_stream(shaped()), 0.01 * without);
  }
}

TEST(ShapedAxis, BothMotorsOfAnAxisAreShaped) {
  const auto after_move = [](bool is_shaped) {
    config::AxisConfig config = test::gantryAxis();
    config.max_speed = 0.1;
    config.acceleration = config.deceleration = 10.0;
    if (is_shaped) config.input_shaper = shaped().input_shaper;
    Bench bench({config}, test::rigMotors(config));
    const axis::Move move = bench.axis("y").moveTo(0.1 * 2.5 / kFrequency);
    EXPECT_EQ(bench.axis("y").wait(move).end, MoveEnd::kReached);
    if (!is_shaped) bench.machine->advance(shaperTime());
    EXPECT_EQ(bench.pulses("y"), bench.pulses("y.right"));
    EXPECT_EQ(violationsOf(bench.report("y.right")), "");
    return std::pair(ringing(bench, bench.clock.now(), "y"),
                     ringing(bench, bench.clock.now(), "y.right"));
  };
  const auto [left, right] = after_move(false);
  const auto [shaped_left, shaped_right] = after_move(true);
  EXPECT_GT(std::min(left, right), 50.0);
  EXPECT_LE(shaped_left, 0.01 * left);
  EXPECT_LE(shaped_right, 0.01 * right);
}

constexpr double kRadius = 0.02;  // m

// Two turns around (-kRadius, 0).
PathRequest circle() {
  PathRequest path{{"x", "y"}, {}, false, 0.25, 0.0001};
  PathSegment turn;
  turn.shape = PathSegment::Shape::kArcAround;
  turn.plane = {"x", "y"};
  turn.point = {-kRadius, 0.0};
  turn.end = {0.0, 0.0};
  path.segments = {turn, turn};
  return path;
}

struct Pulse {
  double time;
  double x;
  double y;
};

std::vector<Pulse> pulsesOf(Bench& bench) {
  std::vector<Pulse> pulses;
  const test::MotionTrace trace(bench);
  for (const std::string axis : {"x", "y"}) {
    for (const auto& step : trace.steps(axis)) {
      const double place = static_cast<double>(step.count) / kScale;
      pulses.push_back(
          {step.time, axis == "x" ? place : std::nan(""), axis == "y" ? place : std::nan("")});
    }
  }
  std::sort(pulses.begin(), pulses.end(),
            [](const Pulse& a, const Pulse& b) { return a.time < b.time; });
  Pulse now{0.0, 0.0, 0.0};
  for (Pulse& pulse : pulses) {
    if (std::isnan(pulse.x)) pulse.x = now.x;
    if (std::isnan(pulse.y)) pulse.y = now.y;
    now = pulse;
  }
  return pulses;
}

// At the angular velocity w, a shaped circle is a circle again, whose radius is smaller by the
// factor |A1 + A2 exp(-i w t2)|.
TEST(ShapedAxis, ACircleIsAsMuchSmallerAsItsClosedFormSaysAndDoesNotRing) {
  const auto after_path = [](const config::AxisConfig& x, const config::AxisConfig& y) {
    Bench bench({x, y});
    const CoordinatedMove move = bench.machine->followPath(circle());
    EXPECT_EQ(bench.machine->wait(move).end, MoveEnd::kReached);
    if (x.input_shaper.empty()) bench.machine->advance(shaperTime());
    expectClean(bench, "x");
    expectClean(bench, "y");
    const double left =
        std::max(ringing(bench, bench.clock.now(), "x"), ringing(bench, bench.clock.now(), "y"));
    return std::pair(left, pulsesOf(bench));
  };
  const auto [without, exact] = after_path(plain("x"), plain("y"));
  const auto [with, smaller] = after_path(shaped("x"), shaped("y"));
  EXPECT_GT(without, 100.0);
  EXPECT_LE(with, 0.01 * without);
  const auto shaper = motor::inputShaperOf(shaped());
  ASSERT_EQ(shaper->impulses().size(), 2U);
  const double a1 = shaper->impulses()[0].part;
  const double a2 = shaper->impulses()[1].part;
  const double angle = 0.25 / kRadius * static_cast<double>(shaper->impulses()[1].delay_ns) * 1e-9;
  const double radius = kRadius * std::sqrt(a1 * a1 + a2 * a2 + 2.0 * a1 * a2 * std::cos(angle));
  EXPECT_LT(radius, kRadius - 0.0002);
  constexpr double kHalfMicrosteps = 0.71 / kScale;
  const auto expect_radius = [](const std::vector<Pulse>& pulses, double wanted) {
    const double begin = pulses.front().time;
    const double duration = pulses.back().time - begin;
    for (const Pulse& pulse : pulses) {
      const double part = (pulse.time - begin) / duration;
      if (part < 0.2 || part > 0.8) continue;
      ASSERT_NEAR(std::hypot(pulse.x + kRadius, pulse.y), wanted, kHalfMicrosteps + 1e-7);
    }
  };
  expect_radius(exact, kRadius);
  expect_radius(smaller, radius);
}

TEST(ShapedAxis, ACornerIsRoundedByAtMostTheToleranceAndWhatTheShaperAdds) {
  constexpr double kTolerance = 0.0002;
  PathRequest path{{"x", "y"}, {}, false, 0.0, kTolerance};
  path.segments.resize(2);
  path.segments[0].end = {0.03, 0.0};
  path.segments[1].end = {0.03, 0.03};
  const auto farthest = [&path](const config::AxisConfig& x, const config::AxisConfig& y) {
    Bench bench({x, y});
    EXPECT_EQ(bench.machine->wait(bench.machine->followPath(path)).end, MoveEnd::kReached);
    expectClean(bench, "x");
    expectClean(bench, "y");
    double worst = 0.0;
    for (const Pulse& pulse : pulsesOf(bench)) {
      worst = std::max(worst, std::min(std::abs(pulse.y), std::abs(0.03 - pulse.x)));
    }
    return worst;
  };
  const auto shaper = motor::inputShaperOf(shaped());
  const double a2 = shaper->impulses()[1].part;
  const double t2 = static_cast<double>(shaper->impulses()[1].delay_ns) * 1e-9;
  const double lag = a2 * t2;
  const double bound =
      20.0 / 2.0 * ((1.0 - a2) * lag * lag + a2 * (t2 - lag) * (t2 - lag));  // each axis
  const double plainly = farthest(plain("x"), plain("y"));
  const double worst = farthest(shaped("x"), shaped("y"));
  EXPECT_LE(plainly, kTolerance + 1.0 / kScale);
  EXPECT_GT(worst, plainly);
  EXPECT_LE(worst, kTolerance + bound + 1.0 / kScale);
}

}  // namespace
}  // namespace stepdriver
