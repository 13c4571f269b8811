// Axes with motors of phases: a 28BYJ-48 behind a ULN2003.
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/corexy_bench.h"
#include "support/temporary_folder.h"

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::violationsOf;

constexpr double kHalfStepsPerTurn = 64.0 * 63.68395;

config::AxisConfig coilAxis(int microsteps = 2, const std::string& name = "x") {
  config::AxisConfig config;
  config.name = config.joint = name;
  config.kind = config::Kind::kRotary;
  config.driver = driver::driverChip("uln2003");
  config.pins.in1.line = name + ".1";
  config.pins.in2.line = name + ".2";
  config.pins.in3.line = name + ".3";
  config.pins.in4.line = name + ".4";
  config.microsteps = microsteps;
  config.steps_per_unit = kHalfStepsPerTurn * microsteps / 2 / (2.0 * 3.14159265358979323846);
  config.max_speed = 600.0 / config.steps_per_unit;
  config.acceleration = config.deceleration = 2000.0 / config.steps_per_unit;
  config.enable_on_start = true;
  return config;
}

std::string coilsOf(const Bench& bench, const std::string& name = "x") {
  std::string on;
  for (const char* coil : {"1", "2", "3", "4"}) {
    on += bench.rig.outputLevel(name + "." + coil).value_or(false) ? "1" : "0";
  }
  return on;
}

double stepsTo(const config::AxisConfig& config, double steps) {
  return steps / config.steps_per_unit;
}

TEST(Phases, TurnTheMotorByHalfAndFullSteps) {
  for (const int microsteps : {1, 2}) {
    const config::AxisConfig config = coilAxis(microsteps);
    Bench bench({config});
    EXPECT_EQ(coilsOf(bench), "1100");
    EXPECT_EQ(bench.move(stepsTo(config, 1001)).end, MoveEnd::kReached);
    EXPECT_EQ(bench.pulses(), 1001);
    EXPECT_EQ(coilsOf(bench), microsteps == 2 ? "0100" : "0110");
    EXPECT_EQ(bench.move(stepsTo(config, -300)).end, MoveEnd::kReached);
    EXPECT_EQ(bench.pulses(), -300);
    EXPECT_NEAR(bench.report().carriage, bench.axis().state().position * 1000.0, 1e-6);
    EXPECT_EQ(violationsOf(bench.report()), "");
    EXPECT_EQ(bench.report().lost_steps, 0);
  }
}

TEST(Phases, HaveNoCurrentWhileTheMotorIsDisabled) {
  config::AxisConfig config = coilAxis();
  config.enable_on_start = false;
  Bench bench({config});
  EXPECT_EQ(coilsOf(bench), "0000");
  EXPECT_THROW(bench.move(stepsTo(config, 10)), Refused);
  bench.axis().enable(true);
  EXPECT_EQ(coilsOf(bench), "1100");
  bench.move(stepsTo(config, 3));
  EXPECT_EQ(coilsOf(bench), "0010");
  bench.axis().enable(false);
  EXPECT_EQ(coilsOf(bench), "0000");
  EXPECT_FALSE(bench.report().energized);
  bench.machine->enable(true);
  EXPECT_EQ(coilsOf(bench), "0010") << "the pattern continues";
  EXPECT_EQ(bench.move(stepsTo(config, 4)).end, MoveEnd::kReached);
  EXPECT_EQ(bench.report().pulses_forward, 4);
  EXPECT_EQ(violationsOf(bench.report()), "");
  bench.machine.reset();
  EXPECT_EQ(coilsOf(bench), "0000") << "the program has ended";
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, CanStayOnAfterTheEnd) {
  config::AxisConfig config = coilAxis();
  config.disable_on_shutdown = false;
  Bench bench({config});
  bench.move(stepsTo(config, 2));
  bench.machine.reset();
  EXPECT_EQ(coilsOf(bench), "0110");
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, GoOffWhenTheAxisIsIdleAndComeBackForTheNextMove) {
  config::AxisConfig config = coilAxis();
  config.idle_timeout = 0.5;
  Bench bench({config});
  bench.move(stepsTo(config, 5));
  bench.machine->advance(0.6);
  EXPECT_EQ(coilsOf(bench), "0000");
  EXPECT_EQ(bench.move(stepsTo(config, 7)).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 7);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, GoOffAtAnEmergencyStopThatDisables) {
  const config::AxisConfig config = coilAxis();
  machine::MachineOptions options;
  options.emergency_disable = machine::EmergencyDisable::kOff;
  Bench bench({config}, Bench::rigAxes({config}), false, 0.0, options);
  bench.axis().moveTo(stepsTo(config, 5000));
  bench.machine->advance(1.0);
  bench.machine->emergencyStop();
  bench.machine->advance(0.1);
  EXPECT_EQ(coilsOf(bench), "0000");
  const std::int64_t pulses = bench.pulses();
  bench.machine->recover();
  bench.axis().enable(true);
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_GT(pulses, 100);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, ContinueTheirPatternWhenTheMotorPowerComesBack) {
  config::AxisConfig config = coilAxis();
  config.holds_position_unpowered = true;
  machine::MachineOptions options;
  options.motor_power = config::MotorPowerConfig{};
  options.motor_power->line = "power";
  Bench bench({config}, Bench::rigAxes({config}), false, 0.0, options);
  bench.axis().setPosition(0.0);
  bench.move(stepsTo(config, 3));
  EXPECT_EQ(coilsOf(bench), "0010");
  bench.machine->emergencyStop();
  bench.machine->advance(10.0);
  ASSERT_EQ(bench.rig.outputLevel("power"), false);
  bench.machine->recover();
  bench.axis().enable(true);
  EXPECT_EQ(coilsOf(bench), "0010");
  EXPECT_TRUE(bench.axis().state().position_valid);
  EXPECT_EQ(bench.move(stepsTo(config, 4)).end, MoveEnd::kReached);
  EXPECT_NEAR(bench.report().carriage, bench.axis().state().position * 1000.0, 1e-6);
  EXPECT_EQ(bench.report().pulses_forward, 4);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, NameTheLineThatFailsAndRecover) {
  const config::AxisConfig config = coilAxis();
  Bench bench({config});
  bench.rig.failWrites("x.3", 3, EIO);
  const axis::MoveResult result = bench.move(stepsTo(config, 200));
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("the IN3 line x.3 can't be written"), std::string::npos)
      << result.message;
  EXPECT_FALSE(bench.axis().state().position_valid);
  bench.rig.clearWriteFault("x.3");
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Phases, TellALineThatFailsWhenTheyGetCurrent) {
  config::AxisConfig config = coilAxis();
  config.enable_on_start = false;
  Bench bench({config});
  bench.rig.failWrites("x.2", 0, EIO);
  EXPECT_THROW(bench.axis().enable(true), Error);
  EXPECT_NE(bench.axis().state().fault.find("the IN2 line x.2 can't be written"), std::string::npos)
      << bench.axis().state().fault;
  bench.rig.clearWriteFault("x.2");
  bench.machine->recover();
  bench.axis().enable(true);
  EXPECT_EQ(coilsOf(bench), "1100");
}

TEST(Phases, OfTwoMotorsStepTogether) {
  config::AxisConfig config = coilAxis();
  config.motor = "left";
  config::MotorConfig twin = config;
  twin.motor = "right";
  twin.pins.in1.line = "y.1";
  twin.pins.in2.line = "y.2";
  twin.pins.in3.line = "y.3";
  twin.pins.in4.line = "y.4";
  config.twins = {twin};
  const config::AxisConfig alone = coilAxis(2, "y");
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({coilAxis(), alone});
  rig[1].name = config.traceName(1);
  Bench bench({config}, rig);
  EXPECT_EQ(bench.move(stepsTo(config, 155)).end, MoveEnd::kReached);
  EXPECT_EQ(coilsOf(bench), coilsOf(bench, "y"));
  EXPECT_EQ(bench.pulses(config.traceName(1)), 155);
  EXPECT_EQ(violationsOf(bench.report(config.traceName(1))), "");
}

TEST(Phases, MoveAxesThatShareTheirMotors) {
  std::vector<config::AxisConfig> axes = {coilAxis(2, "x"), coilAxis(2, "y")};
  test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
  Bench bench(axes);
  EXPECT_EQ(bench.move(stepsTo(axes[0], 101), "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench.move(stepsTo(axes[1], 50), "y").end, MoveEnd::kReached);
  bench.axis("x").enable(false);
  EXPECT_EQ(coilsOf(bench, "x") + coilsOf(bench, "y"), "00000000");
  bench.axis("x").enable(true);
  EXPECT_EQ(bench.move(stepsTo(axes[0], 0), "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 50);
  EXPECT_EQ(bench.pulses("y"), -50);
  for (const char* name : {"x", "y"}) EXPECT_EQ(violationsOf(bench.report(name)), "") << name;
}

TEST(Phases, ShareAMachineAndALineWithADriverThatTakesPulses) {
  const config::AxisConfig coil = coilAxis(2, "y");
  config::AxisConfig pulses = test::linearAxis("x");
  Bench bench({pulses, coil});
  const auto move = bench.machine->moveLine({{"x", "y"}, {0.02, stepsTo(coil, 400)}});
  EXPECT_EQ(bench.machine->wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 1600);
  EXPECT_EQ(bench.pulses("y"), 400);
  EXPECT_EQ(violationsOf(bench.report("x")), "");
  EXPECT_EQ(violationsOf(bench.report("y")), "");
}

TEST(Phases, FollowRandomMovesThatTakeOverFromEachOther) {
  std::mt19937_64 random(11);
  for (const int microsteps : {1, 2}) {
    config::AxisConfig config = coilAxis(microsteps);
    config.backlash = stepsTo(config, 7.3);
    Bench bench({config});
    for (int i = 0; i < 60; ++i) {
      bench.axis().moveTo(stepsTo(config, static_cast<double>(random() % 400)));
      bench.machine->advance(1e-3 * static_cast<double>(random() % 500));
      if (random() % 8 == 0) bench.axis().stop();
      if (random() % 16 == 0) {
        bench.machine->advance(2.0);
        bench.axis().enable(false);
        bench.axis().enable(true);
      }
    }
    EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
    EXPECT_EQ(violationsOf(bench.report()), "");
    EXPECT_EQ(bench.report().lost_steps, 0);
  }
}

class PhasesAfterARestart : public testing::Test {
 protected:
  PhasesAfterARestart() {
    config_.holds_position_unpowered = true;
    options_.state_file = folder_.path() + "/state";
    bench_ = std::make_unique<Bench>(std::vector<config::AxisConfig>{config_},
                                     Bench::rigAxes({config_}), false, 0.0, options_);
    bench_->axis().setPosition(0.0);
  }
  void start() {
    bench_->machine.reset();
    bench_->machine = std::make_unique<test::UnthreadedMachine>(
        std::vector<config::AxisConfig>{config_}, bench_->backend, bench_->clock, options_);
  }
  axis::AxisState state() { return bench_->axis().state(); }

  config::AxisConfig config_ = coilAxis();
  const test::TemporaryFolder folder_;
  machine::MachineOptions options_;
  std::unique_ptr<Bench> bench_;
};

TEST_F(PhasesAfterARestart, ContinueThePatternOfTheStateFile) {
  for (int i = 1; i <= 9; ++i) {
    bench_->move(stepsTo(config_, 3.0 * i));
    const std::string coils = coilsOf(*bench_);
    const double carriage = bench_->report().carriage;
    start();
    EXPECT_EQ(coilsOf(*bench_), coils);
    EXPECT_EQ(bench_->report().carriage, carriage) << "the motor has jumped";
    EXPECT_TRUE(state().position_valid) << state().position_note;
    EXPECT_NEAR(state().position * config_.steps_per_unit, 3.0 * i, 1e-9);
  }
  EXPECT_EQ(violationsOf(bench_->report()), "");
}

TEST_F(PhasesAfterARestart, HaveNoValidPositionWithoutIt) {
  bench_->move(stepsTo(config_, 3));
  options_.state_file = "";
  start();
  EXPECT_EQ(coilsOf(*bench_), "1100");
  EXPECT_FALSE(state().position_valid);
}

TEST_F(PhasesAfterARestart, HaveNoValidPositionIfTheModeLacksThePattern) {
  bench_->move(stepsTo(config_, 3));
  config_ = coilAxis(1);
  config_.holds_position_unpowered = true;
  config_.steps_per_unit *= 2.0;  // as before: the file is for an axis of this scale
  start();
  EXPECT_FALSE(state().position_valid);
  EXPECT_NE(state().position_note.find("by up to two full steps"), std::string::npos)
      << state().position_note;
}

}  // namespace
}  // namespace stepdriver
