#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

// Homing on the rig: 80 steps/mm, switches at -100 mm and 100 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingPhase;
using axis::HomingResult;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr double kStep = 1.0 / 80'000.0;  // [m]

/// Towards min at 50 mm/s, latched at 5 mm/s, 2 mm off the trigger point, which is at -0.1 m.
axis::AxisConfig homingAxis(const std::string& name = "x") {
  axis::AxisConfig config = linearAxis(name);
  axis::HomingConfig homing;
  homing.seek_speed = 0.05;
  homing.latch_speed = 0.005;
  homing.pull_off = 0.002;
  homing.offset = -0.1;
  homing.max_travel = 0.3;
  config.homing = homing;
  return config;
}

class HomingTest : public testing::Test {
 protected:
  void build(const axis::AxisConfig& config,
             const std::function<void(sim::RigAxisSpec&)>& change = {}) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    if (change) change(specs[0]);
    bench = std::make_unique<Bench>(std::vector<axis::AxisConfig>{config}, specs);
  }
  void SetUp() override { build(homingAxis()); }

  axis::Axis& x() { return bench->axis(); }
  double carriage() { return bench->report().carriage / 1000.0; }

  /// Homed, with the trigger point at the offset, whose place on the rig is `place` [m].
  void expectHomed(const HomingResult& result, double place = -0.1) {
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    const axis::AxisState state = x().state();
    EXPECT_TRUE(state.homed);
    EXPECT_TRUE(state.position_valid);
    EXPECT_FALSE(state.moving);
    EXPECT_TRUE(state.enabled);
    EXPECT_EQ(state.homing, HomingPhase::kNone);
    EXPECT_DOUBLE_EQ(result.position, state.position);
    const double offset = x().config().homing->offset;
    EXPECT_NEAR(state.position - offset, carriage() - place, kStep);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(HomingTest, TakesTheHalfStepLineWhereTheSwitchClosedForTheTriggerPoint) {
  expectHomed(x().home());
  // The step to the switch at -8000 steps went out where the curve crossed -7999.5: 2 mm off that is
  // -7839.5, which rounds to -7840.
  EXPECT_NEAR(carriage(), -0.098, 1e-9);
  EXPECT_NEAR(x().state().position, -0.1 + 159.5 * kStep, 1e-12);
  EXPECT_EQ(violationsOf(bench->report()), "");
  EXPECT_EQ(bench->machine->figures().slips, 0U);
}

}  // namespace
}  // namespace stepdriver
