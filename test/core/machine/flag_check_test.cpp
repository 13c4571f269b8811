#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/gantry_bench.h"
#include "support/homing_kinds_bench.h"

// Lost steps, seen when an axis passes the flag of its homing again: 80 steps/mm, the flag is from
// 20 mm to 30 mm on the rig, and the positions are those of the rig.

namespace stepdriver {
namespace {

using config::FlagCheck;
using config::HomingKind;
using test::Bench;
using test::homingAxis;
using test::kPi;

config::AxisConfig checkedAxis(FlagCheck check = FlagCheck::kFault,
                               HomingKind kind = HomingKind::kFlag) {
  config::AxisConfig config = homingAxis();
  config.homing->kind = kind;
  config.homing->at_max = true;
  config.homing->input = "flag";
  config.homing->pull_off = 0.0;
  config.homing->offset = kind == HomingKind::kFlagCentre ? 0.025 : 0.02;
  config.homing->final_position = 0.0;
  config.homing->check_at_flag = check;
  config.homing->flag_tolerance = 0.0002;
  return config;
}

class FlagCheckTest : public testing::Test {
 protected:
  void build(const config::AxisConfig& config,
             const std::function<void(sim::RigAxisSpec&, sim::SwitchSpec&)>& change = {}) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    sim::SwitchSpec contact;
    contact.line = "io.flag";
    contact.active_level = true;
    contact.position = 20.0;
    contact.end = 30.0;
    contact.hysteresis = 0.3;
    contact.bounces = 3;
    contact.bounce_ns = 200'000;
    if (change) change(specs[0], contact);
    specs[0].flags.push_back(contact);
    machine::MachineOptions options;
    config::InputConfig flag;
    flag.name = "flag";
    flag.line = {"io.flag", true, Bias::kAsIs};
    flag.debounce_ns = 2'000'000;
    options.inputs.push_back(flag);
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs, false, 0.0,
                                    options);
  }

  axis::Axis& x() { return bench->axis(); }
  void home() {
    const axis::HomingResult result = x().home();
    ASSERT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
  }
  /// As if so many electrical cycles of 0.8 mm were lost at rest.
  void push(double millimetres) {
    bench->rig.placeCarriage("x", bench->report().carriage + millimetres, bench->clock.now());
    bench->machine->advance(0.5);
  }
  std::string fault() { return x().state().fault; }
  std::string note() { return x().state().position_note; }
  void recover() { bench->machine->recover(); }

  std::unique_ptr<Bench> bench;
};

TEST_F(FlagCheckTest, SaysNothingAsLongAsNoStepIsLost) {
  for (const HomingKind kind : {HomingKind::kFlag, HomingKind::kFlagCentre}) {
    config::AxisConfig config = checkedAxis(FlagCheck::kFault, kind);
    config.backlash = 0.0005;
    config.align_on_microstep_change = true;
    build(config);
    home();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> places(-0.02, 0.06);
    std::uniform_real_distribution<double> speeds(0.005, 0.1);
    for (int i = 0; i < 60; ++i) {
      const axis::Move move = x().moveTo(places(random), false, speeds(random));
      if (i % 5 == 0) {
        bench->machine->advance(0.1);
        x().stop();
      }
      x().wait(move);
      if (i == 30) x().setPosition(x().state().position + 0.001);
      if (i == 40) x().setMicrosteps(8);
      ASSERT_EQ(fault(), "") << i;
      ASSERT_EQ(note(), "") << i;
    }
    EXPECT_TRUE(x().state().homed);
  }
}

TEST_F(FlagCheckTest, FindsStepsThatWereLostToEitherSide) {
  for (const bool forward : {false, true}) {
    build(checkedAxis());
    home();
    push(forward ? 0.8 : -0.8);
    const axis::MoveResult result = bench->move(0.06);
    EXPECT_EQ(result.end, axis::MoveEnd::kFault) << result.message;
    EXPECT_EQ(fault(), forward ? "lost steps: the flag flag came 0.8 mm early"
                               : "lost steps: the flag flag came 0.8 mm late");
    EXPECT_FALSE(x().state().position_valid);
    EXPECT_FALSE(x().state().homed);
    recover();
    home();
    EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kReached);
    EXPECT_EQ(fault(), "");
  }
}

TEST_F(FlagCheckTest, FindsThemAtTheOtherSideAndOnTheWayBackToo) {
  build(checkedAxis());
  home();
  // The homing has not passed the far side of the flag: this passing counts.
  bench->move(0.06);
  push(0.8);
  EXPECT_EQ(bench->move(0.025).end, axis::MoveEnd::kReached);
  EXPECT_EQ(fault(), "") << "that side was never passed in this direction";
  EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kFault);
  EXPECT_EQ(fault(), "lost steps: the flag flag came 0.8 mm early");
}

TEST_F(FlagCheckTest, WarnsWithoutStoppingIfThatIsConfigured) {
  build(checkedAxis(FlagCheck::kWarning));
  home();
  push(-0.8);
  EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kReached);
  EXPECT_EQ(note(), "lost steps: the flag flag came 0.8 mm late");
  EXPECT_EQ(fault(), "");
  EXPECT_TRUE(x().state().position_valid);
  home();
  EXPECT_EQ(note(), "");
}

TEST_F(FlagCheckTest, SaysThatTheFlagDoesntCome) {
  build(checkedAxis());
  home();
  push(-8.0);
  EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kFault);
  EXPECT_EQ(fault(), "lost steps: the flag flag didn't come within 0.2 mm of its place");
}

TEST_F(FlagCheckTest, OverlooksLessThanItsTolerance) {
  config::AxisConfig config = checkedAxis();
  config.homing->flag_tolerance = 0.001;
  build(config);
  home();
  push(0.8);
  EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kReached);
  EXPECT_EQ(fault(), "");
}

// The motor can follow 8 m/s^2, and falls out of step at 32 m/s^2.
TEST_F(FlagCheckTest, FindsThatTheRotorHasFallenOutOfStep) {
  config::AxisConfig config = checkedAxis();
  config.max_speed = 0.2;
  config.acceleration = config.deceleration = 32.0;
  config.homing->seek_speed = 0.02;
  build(config, [](sim::RigAxisSpec& spec, sim::SwitchSpec& /*flag*/) {
    spec.motor = sim::MotorSpec{};
    spec.motor->holding_torque = 0.1;
    spec.motor->inertia = 200e-7;
    spec.motor->damping = 0.05;
  });
  bench->may_exceed_limits = true;
  axis::AxisLimits gentle;
  gentle.acceleration = gentle.deceleration = 8.0;
  x().setLimits(gentle);
  home();
  EXPECT_EQ(bench->move(0.05).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench->move(-0.05).end, axis::MoveEnd::kReached);
  ASSERT_EQ(bench->report().lost_steps, 0);
  ASSERT_EQ(fault(), "");
  x().setLimits({});
  EXPECT_EQ(bench->move(0.06).end, axis::MoveEnd::kFault);
  EXPECT_GT(bench->report().lost_steps, 0);
  EXPECT_EQ(fault().rfind("lost steps: the flag flag ", 0), 0U) << fault();
}

TEST_F(FlagCheckTest, OnAnAxisThatTurnsWithoutEndChecksEachTurn) {
  config::AxisConfig config = checkedAxis();
  config.kind = config::Kind::kRotary;
  config.continuous = true;
  config.endstop_min.reset();
  config.endstop_max.reset();
  config.steps_per_unit = 3200.0 / (2.0 * kPi);
  config.max_speed = 2.0 * kPi;
  config.acceleration = config.deceleration = 50.0;
  config.homing->seek_speed = 3.0;
  config.homing->latch_speed = 0.3;
  config.homing->max_travel = 7.0;
  config.homing->offset = 0.0;
  config.homing->final_position.reset();
  config.homing->flag_tolerance = 0.02;
  build(config, [&](sim::RigAxisSpec& spec, sim::SwitchSpec& flag) {
    spec.full_step_travel = 360.0 / 200.0;
    flag.every = 360.0;
  });
  home();
  for (const double turns : {3.2, -2.6, 7.0, 0.4}) {
    EXPECT_EQ(bench->move(2.0 * kPi * turns).end, axis::MoveEnd::kReached);
    ASSERT_EQ(fault(), "") << turns;
  }
  push(7.2);
  EXPECT_EQ(bench->move(-20.0 * kPi).end, axis::MoveEnd::kFault);
  EXPECT_EQ(fault(), "lost steps: the flag flag came 7.2 deg late");
}

// The flag is checked, not the index that comes after it.
TEST(FlagCheckOfAnIndex, FindsLostStepsAtTheFlag) {
  config::AxisConfig config = test::indexAxis("flag");
  config.homing->offset = 0.038;
  config.homing->final_position = 0.0;
  config.homing->check_at_flag = FlagCheck::kFault;
  config.homing->flag_tolerance = 0.0002;
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
  specs[0].flags = {test::flagOf("flag", 20.0, 30.0), test::flagOf("index", 38.0, 38.1)};
  specs[0].flags[1].every = 40.0;
  machine::MachineOptions options;
  options.inputs = {test::inputNamed("flag"), test::inputNamed("index")};
  Bench bench({config}, specs, false, 0.0, options);
  axis::Axis& x = bench.axis();
  for (const double lost : {0.8, -0.8}) {
    const axis::HomingResult homed = x.home();
    ASSERT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
    for (const double place : {0.06, -0.03, 0.09, -0.05, 0.0}) {
      EXPECT_EQ(bench.move(place).end, axis::MoveEnd::kReached) << place;
    }
    ASSERT_EQ(x.state().fault, "");
    bench.rig.placeCarriage("x", bench.report().carriage + lost, bench.clock.now());
    EXPECT_EQ(bench.move(0.06).end, axis::MoveEnd::kFault);
    EXPECT_EQ(x.state().fault, lost > 0.0 ? "lost steps: the flag flag came 0.8 mm early"
                                          : "lost steps: the flag flag came 0.8 mm late");
    EXPECT_FALSE(x.state().homed);
    bench.machine->recover();
  }
}

// The motor that is looked at has lost steps, or the other one, which is made square by homings.
TEST(FlagCheckOfAGantry, FindsThatTheMotorWithTheFlagHasLostSteps) {
  config::AxisConfig config = test::gantryAxis();
  config.max_skew = 0.0;
  config.homing = checkedAxis().homing;
  std::vector<sim::RigAxisSpec> specs = test::rigMotors(config);
  specs[0].flags = {test::flagOf("flag", 20.0, 30.0)};
  machine::MachineOptions options;
  options.inputs = {test::inputNamed("flag")};
  Bench bench({config}, specs, false, 0.0, options);
  axis::Axis& y = bench.axis("y");
  const auto push = [&](const std::string& motor) {
    bench.rig.placeCarriage(motor, bench.report(motor).carriage - 0.8, bench.clock.now());
  };
  const axis::HomingResult homed = y.home();
  ASSERT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
  for (const double place : {0.06, -0.02, 0.07, -0.01}) {
    EXPECT_EQ(bench.move(place, "y").end, axis::MoveEnd::kReached) << place;
  }
  push("y.right");
  EXPECT_EQ(bench.move(0.06, "y").end, axis::MoveEnd::kReached) << "no flag tells of it";
  bench.move(-0.01, "y");
  push("y");
  EXPECT_EQ(bench.move(0.06, "y").end, axis::MoveEnd::kFault);
  EXPECT_EQ(y.state().fault, "lost steps: the flag flag came 0.8 mm late");
  EXPECT_FALSE(y.state().position_valid);
}

// Each of its motors is behind by an electrical cycle, and the flag is one of x.
TEST(FlagCheckOfACoreXy, FindsLostStepsOfItsAxisWhateverTheOtherOneDoes) {
  for (const HomingKind kind : {HomingKind::kFlag, HomingKind::kFlagCentre}) {
    std::vector<config::AxisConfig> axes = test::coreXyAxes();
    axes[0].homing = checkedAxis(FlagCheck::kFault, kind).homing;
    axes[0].homing->seek_speed = 0.02;  // from which the motors stop at once
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    specs[0].flags = {test::flagOf("flag", 20.0, 30.0)};
    machine::MachineOptions options;
    options.inputs = {test::inputNamed("flag")};
    Bench bench(axes, specs, false, 0.0, options);
    bench.axis("y").setPosition(0.0);
    const axis::HomingResult homed = bench.axis().home();
    ASSERT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
    std::mt19937 random(9);
    std::uniform_real_distribution<double> places(-0.02, 0.06);
    for (int i = 0; i < 30; ++i) {
      // Each of them alone, or both at once.
      const axis::Move of_x = bench.axis().moveTo(places(random));
      if (i % 3 != 0) bench.axis("y").wait(bench.axis("y").moveTo(places(random)));
      EXPECT_EQ(bench.axis().wait(of_x).end, axis::MoveEnd::kReached);
      ASSERT_EQ(bench.axis().state().fault, "") << i;
    }
    bench.move(0.0);
    bench.rig.placeCarriage("x", bench.report().carriage - 0.8, bench.clock.now());
    ASSERT_NEAR(bench.report().carriage, -0.8, 0.02);
    bench.axis("y").moveTo(0.03);
    EXPECT_EQ(bench.move(0.06).end, axis::MoveEnd::kFault);
    // The step that meets the flag may be one of y.
    const std::string fault = bench.axis().state().fault;
    EXPECT_EQ(fault.rfind("lost steps: the flag flag came 0.80", 0), 0U) << fault;
    EXPECT_EQ(fault.substr(fault.size() - 8), " mm late");
    EXPECT_FALSE(bench.axis().state().position_valid);
  }
}

}  // namespace
}  // namespace stepdriver
