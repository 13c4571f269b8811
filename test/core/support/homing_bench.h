#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"

namespace stepdriver::test {

/// On the rig with its switches at -100 mm and 100 mm: approaches min at 50 mm/s, latches at 5
/// mm/s, and backs off 2 mm from the trigger point, which is at -0.1 m.
inline config::AxisConfig homingAxis(const std::string& name = "x") {
  config::AxisConfig config = linearAxis(name);
  config::HomingConfig homing;
  homing.seek_speed = 0.05;
  homing.latch_speed = 0.005;
  homing.pull_off = 0.002;
  homing.offset = -0.1;
  homing.max_travel = 0.3;
  config.homing = homing;
  return config;
}

/// How far apart the home positions of several homings are.
class Spread {
 public:
  /// @param error [steps] how far a home position is from where it should be
  void add(double error) {
    least_ = std::min(least_, error);
    most_ = std::max(most_, error);
  }
  /// Expects at most a step from the first to the last, and the last within a step.
  void expectAStep() const {
    EXPECT_LE(most_ - least_, 1.0) << least_ << " to " << most_;
    EXPECT_NEAR(most_, 0.0, 1.0);
    testing::Test::RecordProperty("spread_in_thousandths_of_a_step",
                                  static_cast<int>(1e3 * (most_ - least_)));
  }

 private:
  double least_ = std::numeric_limits<double>::infinity();
  double most_ = -std::numeric_limits<double>::infinity();
};

class HomingTest : public testing::Test {
 protected:
  void build(const config::AxisConfig& config,
             const std::function<void(sim::RigAxisSpec&)>& change = {}) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    if (change) change(specs[0]);
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs);
  }
  void SetUp() override { build(homingAxis()); }

  axis::Axis& x() { return bench->axis(); }
  double carriage() { return bench->report().carriage / 1000.0; }

  /// Expects the axis homed, with the trigger point at the offset; its position on the rig is
  /// `place` [m].
  void expectHomed(const axis::HomingResult& result, double place = -0.1) {
    EXPECT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
    const axis::AxisState state = x().state();
    EXPECT_TRUE(state.homed);
    EXPECT_TRUE(state.position_valid);
    EXPECT_FALSE(state.moving);
    EXPECT_TRUE(state.enabled);
    EXPECT_EQ(state.homing, axis::HomingPhase::kNone);
    EXPECT_DOUBLE_EQ(result.position, state.position);
    const double offset = x().config().homing->offset;
    EXPECT_NEAR(state.position - offset, carriage() - place, kStep);
  }

  std::unique_ptr<Bench> bench;
};

}  // namespace stepdriver::test
