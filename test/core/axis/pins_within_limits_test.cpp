#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/corexy_bench.h"

// What the rig's judge of motions (sim::MotionJudge) says about the steps of whole machines. A
// Bench fails its test if a motor gets steps beyond its limits.

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;

/// 40 steps/mm, 100 mm/s, 1000 mm/s^2, jerk 30000 mm/s^3.
config::AxisConfig smoothAxis(const std::string& name) {
  config::AxisConfig config = linearAxis(name, 40'000.0, 0.1, 1.0);
  config.jerk = 30.0;
  return config;
}

void moveAtRandom(Bench& bench, const std::vector<std::string>& names, int moves) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> place(0.0, 0.05);
  std::uniform_real_distribution<double> pause(0.0, 0.3);
  for (int i = 0; i < moves; ++i) {
    bench.axis(names[random() % names.size()]).moveTo(place(random));
    bench.machine->advance(pause(random));
  }
  bench.machine->advance(3.0);
}

TEST(PinsWithinLimits, OfAnAxisThatIsShapedAtTwoFrequencies) {
  config::AxisConfig config = smoothAxis("x");
  for (const double frequency : {7.0, 14.0}) {
    config.input_shaper.push_back({config::ShaperType::kZv, frequency, 0.0});
  }
  Bench bench({config});
  moveAtRandom(bench, {"x"}, 200);
  EXPECT_GT(bench.report().pulses_forward, 20'000);
}

TEST(PinsWithinLimits, OfAxesThatShareTheirMotors) {
  for (const bool smooth : {false, true}) {
    std::vector<config::AxisConfig> axes{smoothAxis("x"), smoothAxis("y")};
    for (config::AxisConfig& axis : axes) axis.jerk = smooth ? axis.jerk : 0.0;
    test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
    Bench bench(axes);
    moveAtRandom(bench, {"x", "y"}, 500);
    EXPECT_GT(bench.report("x").pulses_forward, 20'000);
  }
}

TEST(PinsWithinLimits, IncludeTheStartSpeed) {
  config::AxisConfig config = linearAxis("x");
  config.start_speed = 0.02;
  Bench bench({config});
  moveAtRandom(bench, {"x"}, 200);
}

TEST(PinsWithinLimits, AreThoseOfTheAxesTimesTheMatrix) {
  std::vector<config::AxisConfig> axes{linearAxis("x", 1'000.0, 0.1, 2.0),
                                       linearAxis("y", 2'000.0, 0.2, 3.0), linearAxis("z")};
  axes[1].deceleration = 4.0;
  axes[0].stop_deceleration = 5.0;
  axes[1].start_speed = 0.01;
  std::vector<config::AxisConfig> sharing(axes.begin(), axes.begin() + 2);
  test::share(sharing, {{1.0, 0.5}, {0.25, -1.0}});
  axes[0].kinematics = axes[1].kinematics = sharing[0].kinematics;

  const sim::MotorLimits a = setup::motorLimits(axes, 0);
  EXPECT_DOUBLE_EQ(a.rate, 1'000.0 * (0.1 + 0.5 * 0.2));
  EXPECT_DOUBLE_EQ(a.acceleration, 1'000.0 * (5.0 + 0.5 * 4.0));
  EXPECT_DOUBLE_EQ(a.start_rate, 1'000.0 * 0.5 * 0.01);
  const sim::MotorLimits b = setup::motorLimits(axes, 1);
  EXPECT_DOUBLE_EQ(b.rate, 2'000.0 * (0.25 * 0.1 + 0.2));
  const sim::MotorLimits z = setup::motorLimits(axes, 2);
  EXPECT_DOUBLE_EQ(z.rate, 8'000.0);
  EXPECT_DOUBLE_EQ(z.acceleration, 80'000.0);
}

}  // namespace
}  // namespace stepdriver
