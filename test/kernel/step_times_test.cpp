#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kernel_bench.h"
#include "stepdriver_core/axis/axis.h"
#include "support/test_board.h"
#include "waveform.h"

// The times of steps that go through the real libgpiod to a real kernel's lines, on that kernel's
// virtual time (`run.sh --time-travel`): there a sleep is exact, calculations take no time, and
// only reading the clock does. Held against the closed form of the motion, not against the planner.

namespace stepdriver::kernel {
namespace {

/// What a read of the clock takes there; the kernel reads it for each event of a trace, too.
constexpr std::int64_t kClockRead = 256;

/// A sleep is exact there, and each read of the clock while spinning is a system call.
constexpr pulse::Nanoseconds kGuard = 2'000;

/// When step k of a move of n steps from rest to rest is due, in nanoseconds after the start: where
/// the motion crosses k - 1/2, with the ramps as far as the speed or half of the way.
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
  chip::Model driver;
  double steps_s;
  double steps_s2;
};

void PrintTo(const Speed& speed, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << speed.name;
}

class StepTimes : public testing::TestWithParam<Speed> {
 protected:
  void SetUp() override {
    const std::string missing = test::gpioSimBoard().missing();
    if (!missing.empty()) GTEST_SKIP() << missing;
    if (!timeTravels()) GTEST_SKIP() << "runs in virtual time (run.sh --time-travel)";
  }
};

TEST_P(StepTimes, AreThoseOfTheClosedFormToAMicrosecond) {
  const Speed& speed = GetParam();
  auto config = axisAt("x", speed.driver, {{"board-0:0"}, {"board-0:1"}, {"board-0:2"}});
  config.max_speed = speed.steps_s / config.steps_per_unit;
  config.acceleration = config.deceleration = speed.steps_s2 / config.steps_per_unit;
  KernelBench bench({config}, kGuard);
  const std::vector<std::int64_t> moves = {3'000, -4'000, 37};
  for (const std::int64_t move : moves) {
    EXPECT_EQ(bench.axis("x").wait(bench.start("x", move)).end, axis::MoveEnd::kReached);
  }
  const machine::EngineFigures figures = bench.figures();
  const std::int64_t position = bench.count("x");
  const KernelTrace trace = bench.finish(speed.name);
  const Waveform seen = waveformOf(trace, wiredAxis(config, trace));
  EXPECT_TRUE(seen.violations.empty()) << reportOf(seen);
  EXPECT_EQ(seen.position(), position);
  EXPECT_EQ(figures.slips, 0U);

  std::size_t first = 0;
  double worst = 0.0;
  for (const std::int64_t move : moves) {
    const std::int64_t n = std::abs(move);
    ASSERT_GE(seen.pulses.size(), first + static_cast<std::size_t>(n));
    // The start can't be seen from outside: it is where no step comes before its time.
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
  std::printf(
      "[ KERNEL   ] %zu edges read from the kernel at up to %.0f steps/s: step times within "
      "%.0f ns of the closed form, %zu violations\n",
      seen.edges, speed.steps_s, worst, seen.violations.size());
  EXPECT_LE(worst, 1'000.0 + kClockRead);
}

INSTANTIATE_TEST_SUITE_P(At, StepTimes,
                         testing::Values(Speed{"1kHz", chip::Model::kTb6600, 1e3, 5e3},
                                         Speed{"8kHz", chip::Model::kDrv8825, 8e3, 8e4},
                                         Speed{"20kHz", chip::Model::kA4988, 2e4, 4e5},
                                         Speed{"50kHz", chip::Model::kA4988, 5e4, 2e6}),
                         [](const auto& kind) { return "UpTo" + std::string(kind.param.name); });

}  // namespace
}  // namespace stepdriver::kernel
