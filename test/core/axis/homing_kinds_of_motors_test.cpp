#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/corexy_bench.h"
#include "support/gantry_bench.h"
#include "support/homing_kinds_bench.h"

// Homings to a flag, an index or a block of an axis with two motors, and of axes that share theirs.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using config::HomingKind;
using test::flagOf;
using test::inputNamed;
using test::kStep;
using test::Spread;

constexpr int kStarts = 50;

machine::MachineOptions namedInputs() {
  machine::MachineOptions options;
  options.inputs = {inputNamed("flag"), inputNamed("index"), inputNamed("stall")};
  return options;
}

/// [mm] A whole microstep.
double drawPlace(std::mt19937& random, double first, double last) {
  return std::round(std::uniform_real_distribution<double>(first, last)(random) * 80.0) / 80.0;
}

// ---- a gantry ----

class GantryHomingKinds : public test::GantryTest {
 protected:
  static config::AxisConfig gantryWith(const config::AxisConfig& single) {
    config::AxisConfig config = test::gantryAxis();
    config.max_skew = 0.0;  // it isn't squared
    config.homing = single.homing;
    config.steps_per_round = single.steps_per_round;
    return config;
  }

  /// Homes from random places, with a beam that isn't square.
  /// @param trigger [m] where the carriage of the motor that finds it is then
  /// @param finds which one that is, after the homing
  void homeFromRandomPlaces(const config::AxisConfig& config, double first, const Change& change,
                            double trigger, const std::function<sim::RigAxisReport()>& finds) {
    std::mt19937 random(37);
    Spread spread;
    for (int i = 0; i < kStarts; ++i) {
      const double start = drawPlace(random, first, 24.0);
      const double racked = drawPlace(random, -2.0, 2.0);
      std::vector<sim::RigAxisSpec> specs = test::rigMotors(config);
      specs[0].start = start;
      specs[1].start = start + racked;
      change(specs[0], specs[1]);
      bench = std::make_unique<test::Bench>(std::vector<config::AxisConfig>{config}, specs, false,
                                            0.0, namedInputs());
      const HomingResult result = y().home();
      ASSERT_EQ(result.end, HomingEnd::kHomed)
          << start << ", racked by " << racked << ": " << result.message;
      ASSERT_EQ(y().state().fault, "") << start;
      ASSERT_LE(std::abs(skew() - racked), 1.001e3 * kStep * config.homing->approaches) << start;
      expectNoViolations();
      spread.add(
          (y().state().position - config.homing->offset - (finds().carriage / 1000.0 - trigger)) /
          kStep);
    }
    spread.expectAStep();
  }
};

TEST_F(GantryHomingKinds, ToAFlagOfOneMotorKeepsItsSkew) {
  for (const HomingKind kind : {HomingKind::kFlag, HomingKind::kFlagCentre}) {
    homeFromRandomPlaces(
        gantryWith(test::flagAxis(kind)), -97.0,
        [](auto& left, auto&) { left.flags = {flagOf("flag", 20.0, 30.0)}; },
        kind == HomingKind::kFlag ? 0.02 : 0.025, [this] { return left(); });
  }
}

TEST_F(GantryHomingKinds, ToAnIndexOfOneMotorKeepsItsSkew) {
  for (const std::string flag : {"flag", ""}) {
    homeFromRandomPlaces(
        gantryWith(test::indexAxis(flag)), flag.empty() ? -1.0 : -97.0,
        [](auto& left, auto& right) {
          left.flags = {flagOf("index", 38.0, 38.1)};
          left.flags[0].every = 40.0;
          right.flags = {flagOf("flag", 20.0, 30.0)};
        },
        0.038, [this] { return left(); });
  }
}

// The motor that is ahead meets it first, and with each report the other one comes closer by the
// step that the block has stopped.
TEST_F(GantryHomingKinds, ToABlockEndsAtTheFirstMotorThatMeetsIt) {
  for (const int approaches : {1, 2}) {
    config::AxisConfig config = gantryWith(test::blockAxis(approaches));
    config.endstop_min.reset();
    config.twins[0].endstop_min.reset();
    homeFromRandomPlaces(
        config, -77.0,
        [](auto& left, auto& right) {
          for (auto* motor : {&left, &right}) {
            motor->block_min = -80.0;
            motor->stall_line = "io.stall";
          }
        },
        -0.08, [this] { return skew() < 0.0 ? right() : left(); });
  }
}

TEST_F(GantryHomingKinds, ToABlockAreReportedByTheFaultOutputOfEitherMotor) {
  config::AxisConfig config = gantryWith(test::blockAxis(2));
  config.homing->input = "";
  test::giveDrivers(config, driver::driverChip("drv8825"));
  config.endstop_min.reset();
  config.twins[0].endstop_min.reset();
  config.fault = config::FaultPin{"left.fault"};
  config.twins[0].fault = config::FaultPin{"right.fault"};
  homeFromRandomPlaces(
      config, -77.0,
      [&config](auto& left, auto& right) {
        for (auto* motor : {&left, &right}) {
          motor->block_min = -80.0;
          motor->stall_line = motor->fault_line;
          motor->stall_active = *config.driver.fault_active;
        }
      },
      -0.08, [this] { return skew() < 0.0 ? right() : left(); });
}

// ---- axes that share their motors ----

class CoreXyHomingKinds : public testing::Test {
 protected:
  /// x is homed as this axis is; y stays where it is.
  void homeFromRandomPlaces(const config::AxisConfig& single, double trigger,
                            const sim::SwitchSpec& contact) {
    std::vector<config::AxisConfig> axes = test::coreXyAxes();
    axes[0].homing = single.homing;
    axes[0].homing->seek_speed = 0.02;  // from which the motors stop at once
    axes[0].homing->latch_speed = std::min(axes[0].homing->latch_speed, 0.005);
    axes[0].endstop_min = single.endstop_min;
    axes[0].endstop_max = single.endstop_max;
    std::mt19937 random(37);
    Spread spread;
    for (int i = 0; i < kStarts; ++i) {
      std::vector<sim::RigAxisSpec> specs = test::Bench::rigAxes(axes);
      specs[0].start = drawPlace(random, -79.0, 79.0);
      specs[1].start = drawPlace(random, -99.0, 99.0);
      specs[0].flags = {contact};
      test::Bench bench(axes, specs, false, 0.0, namedInputs());
      bench.axis("y").setPosition(0.01);
      const HomingResult result = bench.axis("x").home();
      ASSERT_EQ(result.end, HomingEnd::kHomed) << specs[0].start << ": " << result.message;
      for (const std::string name : {"x", "y"}) {
        EXPECT_TRUE(bench.axis(name).state().position_valid) << name;
        EXPECT_EQ(test::violationsOf(bench.report(name)), "") << name;
      }
      ASSERT_NEAR(bench.report("y").carriage, specs[1].start, 1e-9);
      ASSERT_EQ(bench.axis("y").state().position, 0.01);
      spread.add((result.position - axes[0].homing->offset -
                  (bench.report("x").carriage / 1000.0 - trigger)) /
                 kStep);
    }
    spread.expectAStep();
  }
};

TEST_F(CoreXyHomingKinds, ToAFlagLeaveTheOtherAxisWhereItStands) {
  homeFromRandomPlaces(test::flagAxis(), 0.02, flagOf("flag", 20.0, 30.0));
  homeFromRandomPlaces(test::flagAxis(HomingKind::kFlagCentre), 0.025, flagOf("flag", 20.0, 30.0));
}

// Its report comes before a motor has lost a step.
TEST_F(CoreXyHomingKinds, ToABlockLeaveTheOtherAxisWhereItStands) {
  for (const int approaches : {1, 2}) {
    homeFromRandomPlaces(test::blockAxis(approaches), -0.08, flagOf("stall", -90.0, -80.0));
  }
}

}  // namespace
}  // namespace stepdriver
