#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/homing_bench.h"

namespace stepdriver::test {

/// A motor of the axis y, its pins wired like those of an axis with that name.
inline config::MotorConfig motorNamed(const std::string& name) {
  config::MotorConfig motor = linearAxis(name);
  motor.motor = name;
  return motor;
}

/// Gives a motor another driver, with the pins that it has; microstep pins are strapped.
inline void giveDriver(config::MotorConfig& motor, const driver::DriverChip& chip) {
  motor.driver = chip;
  config::Pins& pins = motor.pins;
  pins.ms1 = pins.ms2 = pins.ms3 = {};
  if (!chip.sleep_asleep) pins.sleep = {};
  if (!chip.reset_held) pins.reset = {};
}

/// The same driver for all motors of an axis.
inline void giveDrivers(config::AxisConfig& axis, const driver::DriverChip& chip) {
  giveDriver(axis, chip);
  for (config::MotorConfig& twin : axis.twins) giveDriver(twin, chip);
}

/// The axis y with the motors left and right, each with both switches, 80 microsteps/mm. Its homing
/// is homingAxis()'s. The motors may get 6 mm apart.
inline config::AxisConfig gantryAxis() {
  config::AxisConfig config = homingAxis("y");
  static_cast<config::MotorConfig&>(config) = motorNamed("left");
  config.twins.push_back(motorNamed("right"));
  config.max_skew = 0.006;
  return config;
}

/// The motors of an axis on the rig.
inline std::vector<sim::RigAxisSpec> rigMotors(const config::AxisConfig& config) {
  std::vector<sim::RigAxisSpec> specs;
  for (std::size_t i = 0; i < config.motors(); ++i) {
    config::AxisConfig alone = config;
    alone.twins.clear();
    static_cast<config::MotorConfig&>(alone) = config.motorAt(i);
    alone.name = config.traceName(i);
    specs.push_back(rigAxis(alone));
  }
  return specs;
}

class GantryTest : public testing::Test {
 protected:
  using Change = std::function<void(sim::RigAxisSpec& left, sim::RigAxisSpec& right)>;

  void build(const config::AxisConfig& config, const Change& change = {}) {
    std::vector<sim::RigAxisSpec> specs = rigMotors(config);
    if (change) change(specs.at(0), specs.at(1));
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs);
  }
  void SetUp() override { build(gantryAxis()); }

  axis::Axis& y() { return bench->axis("y"); }
  sim::RigAxisReport left() { return bench->report("y"); }
  sim::RigAxisReport right() { return bench->report("y.right"); }
  /// [mm] How far the right carriage is ahead.
  double skew() { return right().carriage - left().carriage; }
  void expectNoViolations() {
    EXPECT_EQ(violationsOf(left()), "");
    EXPECT_EQ(violationsOf(right()), "");
  }

  std::unique_ptr<Bench> bench;
};

}  // namespace stepdriver::test
