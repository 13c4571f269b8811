#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ostream>
#include <string>
#include <vector>

#include "kernel_bench.h"
#include "stepdriver_core/axis/axis.h"
#include "waveform.h"

// Tests the times of steps that go through the real libgpiod to a real kernel's lines, in that
// kernel's virtual time (`run.sh --time-travel`). There a sleep is exact and calculations take no
// time; only reading the clock does. The times are compared with the closed form of the motion, not
// with the planner.

namespace stepdriver::kernel {
namespace {

/// A pulse may have to wait for one write of another axis. That includes reads of the clock before
/// and after the write, and an event for each line of its chip.
constexpr std::int64_t kOtherWrites = 12 * kClockRead;

/// The time at which step k of a move of n steps from rest to rest is due, in nanoseconds after the
/// start: the motion crosses k - 1/2 then. The ramps end at full speed, or halfway.
double dueTime(std::int64_t k, std::int64_t n, double speed, double acceleration) {
  const double way = static_cast<double>(n);
  const double ramp = std::min(speed * speed / (2.0 * acceleration), way / 2.0);
  const double peak = std::sqrt(2.0 * acceleration * ramp);
  const double total = 2.0 * peak / acceleration + (way - 2.0 * ramp) / peak;
  const double line = static_cast<double>(k) - 0.5;
  if (line <= ramp) return 1e9 * std::sqrt(2.0 * line / acceleration);
  if (line >= way - ramp) return 1e9 * (total - std::sqrt(2.0 * (way - line) / acceleration));
  return 1e9 * (peak / acceleration + (line - ramp) / peak);
}

struct Speed {
  const char* name;
  std::string driver;
  double steps_s;
  double steps_s2;
};

void PrintTo(const Speed& speed, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << speed.name;
}

using Moves = std::vector<std::int64_t>;

config::AxisConfig configOf(const std::string& name, const Place& place, const Speed& speed) {
  auto config = axisAt(name, speed.driver, place);
  config.max_speed = speed.steps_s / config.steps_per_unit;
  config.acceleration = config.deceleration = speed.steps_s2 / config.steps_per_unit;
  return config;
}

/// Compares the pulses of these moves.
/// @return the largest difference of a pulse from its time [ns].
double worstOf(const Waveform& seen, const Moves& moves, const Speed& speed) {
  std::size_t first = 0;
  double worst = 0.0;
  for (const std::int64_t move : moves) {
    const std::int64_t n = std::abs(move);
    if (seen.pulses.size() < first + static_cast<std::size_t>(n)) break;
    // The start time isn't visible from outside. It is the one with which no step comes before its
    // time.
    double earliest = 1e18;
    double latest = 0.0;
    for (std::int64_t k = 1; k <= n; ++k) {
      const Pulse& pulse = seen.pulses[first + static_cast<std::size_t>(k) - 1];
      EXPECT_EQ(pulse.forward, move > 0);
      const double start =
          static_cast<double>(pulse.time_ns) - dueTime(k, n, speed.steps_s, speed.steps_s2);
      earliest = std::min(earliest, start);
      latest = std::max(latest, start);
    }
    worst = std::max(worst, latest - earliest);
    first += static_cast<std::size_t>(n);
  }
  EXPECT_EQ(seen.pulses.size(), first);
  return worst;
}

/// The motor feels what the closed form means for it.
void expectNothingLost(const Waveform& seen, const Moves& moves, const Speed& speed,
                       int microsteps) {
  std::vector<Pulse> planned;
  for (const std::int64_t move : moves) {
    const std::int64_t n = std::abs(move);
    if (planned.size() + static_cast<std::size_t>(n) > seen.pulses.size()) return;
    const std::int64_t begin = seen.pulses[planned.size()].time_ns -
                               std::llround(dueTime(1, n, speed.steps_s, speed.steps_s2));
    for (std::int64_t k = 1; k <= n; ++k) {
      planned.push_back(
          {begin + std::llround(dueTime(k, n, speed.steps_s, speed.steps_s2)), move > 0});
    }
  }
  const MotorView felt = motorViewOf(seen.pulses, microsteps);
  EXPECT_EQ(felt.lost_steps, 0);
  EXPECT_NEAR(felt.largest_lag_degrees, motorViewOf(planned, microsteps).largest_lag_degrees, 0.5);
}

void print(std::size_t edges, double steps_s, double worst, std::size_t violations) {
  std::printf(
      "[ KERNEL   ] %zu edges read from the kernel at up to %.0f steps/s: step times within "
      "%.0f ns of the closed form, %zu violations\n",
      edges, steps_s, worst, violations);
}

class StepTimes : public testing::TestWithParam<Speed> {
 protected:
  void SetUp() override {
    if (!missingVirtualTime().empty()) GTEST_SKIP() << missingVirtualTime();
  }
};

TEST_P(StepTimes, AreThoseOfTheClosedFormToAMicrosecond) {
  const Speed& speed = GetParam();
  const auto config = configOf("x", {{"board-0:0"}, {"board-0:1"}, {"board-0:2"}}, speed);
  KernelBench bench({config}, kExactGuard);
  const Moves moves = {3'000, -4'000, 37};
  for (const std::int64_t move : moves) {
    EXPECT_EQ(bench.axis("x").wait(bench.start("x", move)).end, axis::MoveEnd::kReached);
  }
  EXPECT_EQ(bench.figures().slips, 0U);
  const std::int64_t position = bench.count("x");
  const KernelTrace trace = bench.finish(speed.name);
  const Waveform seen = waveformOf(trace, wiredAxis(config, trace));
  const double worst = worstOf(seen, moves, speed);
  EXPECT_TRUE(seen.violations.empty()) << reportOf(seen);
  EXPECT_EQ(seen.position(), position);
  EXPECT_LE(worst, 1'000.0 + kClockRead);
  expectNothingLost(seen, moves, speed, config.microsteps);
  print(seen.edges, speed.steps_s, worst, seen.violations.size());
}

INSTANTIATE_TEST_SUITE_P(At, StepTimes,
                         testing::Values(Speed{"1kHz", "tb6600", 1e3, 5e3},
                                         Speed{"8kHz", "drv8825", 8e3, 8e4},
                                         Speed{"20kHz", "a4988", 2e4, 4e5},
                                         Speed{"50kHz", "a4988", 5e4, 2e6}),
                         [](const auto& kind) { return "UpTo" + std::string(kind.param.name); });

class StepTimesOfTwoAxes : public testing::Test {
 protected:
  void SetUp() override {
    if (!missingVirtualTime().empty()) GTEST_SKIP() << missingVirtualTime();
  }
};

TEST_F(StepTimesOfTwoAxes, AreLaterOnlyByTheWritesOfTheOther) {
  const Speed speed_x{"x", "drv8825", 8e3, 8e4};
  const Speed speed_y{"y", "tb6600", 5e3, 3e4};
  const std::vector<config::AxisConfig> configs = {
      configOf("x", {{"board-0:0"}, {"board-0:1"}, {"board-0:2"}}, speed_x),
      configOf("y", {{"board-1:0"}, {"board-0:5", true}, {"board-1:2"}}, speed_y)};
  KernelBench bench(configs, kExactGuard);
  const Moves moves_x = {3'000, -2'000};
  const Moves moves_y = {-2'000, 1'500};
  for (std::size_t i = 0; i < moves_x.size(); ++i) {
    const axis::Move x = bench.start("x", moves_x[i]);
    const axis::Move y = bench.start("y", moves_y[i]);
    EXPECT_EQ(bench.axis("x").wait(x).end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench.axis("y").wait(y).end, axis::MoveEnd::kReached);
  }
  EXPECT_EQ(bench.figures().slips, 0U);
  const KernelTrace trace = bench.finish("two");
  const Waveform x = waveformOf(trace, wiredAxis(configs[0], trace));
  const Waveform y = waveformOf(trace, wiredAxis(configs[1], trace));
  EXPECT_TRUE(x.violations.empty()) << reportOf(x);
  EXPECT_TRUE(y.violations.empty()) << reportOf(y);
  const double worst = std::max(worstOf(x, moves_x, speed_x), worstOf(y, moves_y, speed_y));
  EXPECT_LE(worst, 1'000.0 + kOtherWrites);
  expectNothingLost(x, moves_x, speed_x, configs[0].microsteps);
  expectNothingLost(y, moves_y, speed_y, configs[1].microsteps);
  print(x.edges + y.edges, speed_x.steps_s, worst, x.violations.size() + y.violations.size());
}

}  // namespace
}  // namespace stepdriver::kernel
