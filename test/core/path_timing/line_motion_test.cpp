#include "path_timing/line_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

// The fastest motion along a line from one speed to another: its end, its limits,
// and durations that are known.

namespace stepdriver {
namespace {

using motion::LineLimits;
using motion::LinePhase;

double durationOf(const std::vector<LinePhase>& phases) {
  double duration = 0.0;
  for (const LinePhase& phase : phases) duration += phase.duration;
  return duration;
}

TEST(LineMotion, HasTheSevenPhasesOfTheFastestFromRestToRest) {
  const auto duration = [](double length, const LineLimits& limits) {
    return durationOf(motion::planLine(length, 0.0, 0.0, limits).value());
  };
  // 1000/1000 + 1000/5000 + 5000/50000
  EXPECT_NEAR(duration(1000.0, {1000.0, 5000.0, 5000.0, 50'000.0}), 1.3, 1e-9);
  EXPECT_NEAR(duration(1000.0, {1e6, 5000.0, 5000.0, 50'000.0}), std::sqrt(0.01 + 0.8) + 0.1, 1e-9);
  EXPECT_NEAR(duration(1000.0, {1e6, 1e6, 1e6, 50'000.0}), 4.0 * std::cbrt(1000.0 / 1e5), 1e-9);
}

TEST(LineMotion, NeedsALineThatIsLongEnoughForTheChangeOfTheSpeed) {
  const LineLimits limits{1000.0, 1e6, 1e6, 50'000.0};
  // From rest to v without an acceleration: v sqrt(v/J).
  const double least = 100.0 * std::sqrt(100.0 / 50'000.0);
  EXPECT_TRUE(motion::planLine(1.001 * least, 0.0, 100.0, limits));
  EXPECT_FALSE(motion::planLine(0.999 * least, 0.0, 100.0, limits));
  EXPECT_FALSE(motion::planLine(1e6, 1001.0, 0.0, limits)) << "beyond the highest speed";
}

// Over twelve decades of lengths and six of times.
TEST(LineMotion, ReachesItsEndWithinTheLimits) {
  std::mt19937 random(36);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int planned = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double unit = std::pow(10.0, number(-6.0, 6.0));
    const double time = std::pow(10.0, number(-3.0, 3.0));
    const LineLimits limits{unit / time, unit / (time * time) * number(0.3, 3.0),
                            unit / (time * time) * number(0.3, 3.0),
                            unit / (time * time * time) * std::pow(10.0, number(-1.0, 2.0))};
    const double begin = number(0.0, 1.0) * limits.speed;
    const double end = number(0.0, 1.0) * limits.speed;
    const double length = unit * number(0.0, 4.0);
    const auto phases = motion::planLine(length, begin, end, limits);
    if (!phases) continue;
    ++planned;
    double way = 0.0;
    double speed = begin;
    double acceleration = 0.0;
    for (const LinePhase& phase : *phases) {
      const double h = phase.duration;
      ASSERT_GT(h, 0.0);
      ASSERT_LE(std::abs(phase.jerk), limits.jerk * (1.0 + 1e-9));
      way += h * (speed + h * (acceleration / 2.0 + h * phase.jerk / 6.0));
      speed += h * (acceleration + h * phase.jerk / 2.0);
      acceleration += h * phase.jerk;
      ASSERT_LE(speed, limits.speed * (1.0 + 1e-9)) << "motion " << i;
      ASSERT_GE(speed, -1e-9 * limits.speed) << "motion " << i;
      ASSERT_LE(acceleration, limits.acceleration * (1.0 + 1e-9)) << "motion " << i;
      ASSERT_GE(acceleration, -limits.deceleration * (1.0 + 1e-9)) << "motion " << i;
    }
    ASSERT_NEAR(way, length, 1e-9 * length) << "motion " << i;
    ASSERT_NEAR(speed, end, 1e-9 * limits.speed) << "motion " << i;
    ASSERT_NEAR(acceleration, 0.0, 1e-7 * limits.acceleration) << "motion " << i;
  }
  EXPECT_GE(planned, 5000);
}

}  // namespace
}  // namespace stepdriver
