#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/tmc_axis.h"

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using test::Bench;
using test::kStep;

constexpr int kGlobalConfiguration = 0x00;
constexpr int kCurrents = 0x10;
constexpr int kChopsAbove = 0x13;
constexpr int kStallAbove = 0x14;
constexpr int kStallBelow = 0x40;
constexpr int kStallOnSpi = 0x6D;
constexpr double kMotorTorque = 0.5;  // [Nm]
constexpr double kWallAt = -50.0;     // [mm]
// Where the rotor stands at the wall, MSCNT is 512. The chip has told of the stall when the field
// is two thirds of a full step further, on average.
constexpr int kWallPhase = 512 - 171;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A driver, and whether its DIAG is wired.
struct Way {
  const char* driver;
  bool has_diag;
  bool isOnSpi() const { return std::string(driver) != "tmc2209"; }
};

config::AxisConfig stallAxis(const Way& way = {"tmc2209", true}) {
  config::AxisConfig config = way.isOnSpi() ? test::spiAxis(way.driver) : test::tmcAxis();
  config.endstop_min.reset();
  config.endstop_max.reset();
  if (way.has_diag) config.fault = config::FaultPin{"x.diag"};
  config.tmc->stall.emplace();
  config.tmc->stall->threshold = way.isOnSpi() ? -40 : 100;
  config.tmc->stall->current = 0.7;
  config.homing.emplace();
  config.homing->kind = config::HomingKind::kStall;
  config.homing->seek_speed = 0.05;
  config.homing->pull_off = 0.01;
  config.homing->max_travel = 0.2;
  config.homing->offset = -0.05;
  return config;
}

/// A machine whose carriage meets a wall, with a friction [parts of the motor's torque].
struct WithWall {
  explicit WithWall(const config::AxisConfig& config, double friction = 0.0, bool walled = true)
      : bench({config}, specs(config, friction, walled)) {
    bench.may_exceed_limits = true;  // it stops at once
    before = registers();
  }
  static std::vector<sim::RigAxisSpec> specs(const config::AxisConfig& config, double friction,
                                             bool walled) {
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({config});
    rig[0].motor.emplace();
    rig[0].motor->holding_torque = kMotorTorque;
    rig[0].motor->friction = friction * kMotorTorque;
    if (config.fault) rig[0].fault_line = config.fault->line;
    if (walled) rig[0].block_min = kWallAt;
    return rig;
  }
  axis::Axis& x() { return bench.axis(); }
  /// [microsteps] By how much the position is wrong, by the carriage at rest.
  double error() { return (x().state().position - bench.report().carriage / 1e3) / kStep; }
  std::vector<std::uint32_t> registers() {
    std::vector<std::uint32_t> values;
    for (const int number :
         {kGlobalConfiguration, kCurrents, kChopsAbove, kStallAbove, kStallBelow, kStallOnSpi}) {
      values.push_back(bench.rig.registerOf("x", number));
    }
    return values;
  }
  void expectRegistersAsBefore() { EXPECT_EQ(registers(), before); }

  Bench bench;
  std::vector<std::uint32_t> before;
};

class StallHoming : public ::testing::TestWithParam<Way> {};

TEST_P(StallHoming, EndsWhereTheMotorIsBlocked) {
  WithWall machine(stallAxis(GetParam()));
  const HomingResult result = machine.x().home();
  ASSERT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_TRUE(contains(result.message, "x is homed at MSCNT ")) << result.message;
  EXPECT_TRUE(machine.x().state().homed);
  EXPECT_EQ(machine.x().state().fault, "");
  EXPECT_NEAR(machine.x().state().position, -0.04, kStep);
  // Within an electrical cycle of the wall.
  EXPECT_LT(std::abs(machine.error()), 64.0);
  machine.expectRegistersAsBefore();
  machine.bench.move(0.0);
  machine.bench.machine->advance(2.0);
  EXPECT_EQ(machine.x().state().fault, "");
  const HomingResult again = machine.x().home();
  EXPECT_TRUE(contains(again.message, " m from where it was homed before")) << again.message;
  EXPECT_FALSE(contains(result.message, "before")) << result.message;
}

/// Of five loads, by DIAG or by the bus: STEPDRIVER_STALL_HOMINGS is how many of a chip altogether.
int homingsOfEach(const Way& way) {
  const char* const wanted = std::getenv("STEPDRIVER_STALL_HOMINGS");
  if (wanted != nullptr) return std::max(1, std::atoi(wanted) / 10);
  return way.isOnSpi() ? 5 : 20;
}

// Two hundred of a TMC2209 and fifty of each other chip, from everywhere, at loads of up to 40 % of
// the torque.
TEST_P(StallHoming, FindsTheSameMicrostepEachTimeByThePhase) {
  config::AxisConfig config = stallAxis(GetParam());
  config.tmc->stall->phase = kWallPhase;
  std::mt19937 random(3);
  double least = 1e9;
  double most = -1e9;
  for (const double friction : {0.0, 0.1, 0.2, 0.3, 0.4}) {
    WithWall machine(config, friction);
    for (int i = 0; i < homingsOfEach(GetParam()); ++i) {
      const HomingResult result = machine.x().home();
      ASSERT_EQ(result.end, HomingEnd::kHomed) << friction << ": " << result.message;
      machine.bench.machine->advance(0.3);
      least = std::min(least, machine.error());
      most = std::max(most, machine.error());
      machine.x().wait(machine.x().moveTo(-0.03 + 1e-4 * static_cast<double>(random() % 500)));
    }
  }
  RecordProperty("least_microsteps", std::to_string(least));
  RecordProperty("most_microsteps", std::to_string(most));
  EXPECT_LE(most - least, 1.0) << "from " << least << " to " << most << " microsteps";
  EXPECT_LT(std::abs(most), 64.0);
}

TEST_P(StallHoming, BeginsAtTheWall) {
  config::AxisConfig config = stallAxis(GetParam());
  std::vector<sim::RigAxisSpec> rig = WithWall::specs(config, 0.1, true);
  rig[0].start = kWallAt + 0.1;
  Bench bench({config}, rig);
  bench.may_exceed_limits = true;
  const HomingResult result = bench.axis().home();
  ASSERT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(bench.axis().state().position * 1e3, bench.report().carriage, 0.4);
}

// The registers are as before, whatever ends it.
TEST_P(StallHoming, LeavesItsRegistersWhenItFailsOrIsStopped) {
  WithWall without(stallAxis(GetParam()), 0.1, false);
  HomingResult result = without.x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_TRUE(contains(result.message, "didn't detect a stall within max_travel"))
      << result.message;
  without.bench.machine->advance(0.3);
  without.expectRegistersAsBefore();
  EXPECT_EQ(without.x().state().fault, "");

  WithWall stopped(stallAxis(GetParam()));
  bool armed = false;
  result = stopped.x().home([&] {
    armed = armed || stopped.bench.rig.registerOf("x", kStallAbove) != 0;
    return armed;
  });
  EXPECT_TRUE(armed);
  EXPECT_EQ(result.end, HomingEnd::kCancelled) << result.message;
  stopped.bench.machine->advance(0.3);
  stopped.expectRegistersAsBefore();
}

TEST_P(StallHoming, IsArmedAtConstantSpeedOnly) {
  config::AxisConfig config = stallAxis(GetParam());
  config.tmc->spread_cycle_above = 400.0;
  WithWall machine(config);
  double slowest = 1.0;
  const auto written = [&machine](int number) { return machine.bench.rig.registerOf("x", number); };
  const std::uint32_t run = written(kCurrents) >> 8U & 0x1FU;
  machine.x().home([&] {
    if (written(kStallAbove) != 0 && machine.x().state().moving) {
      slowest = std::min(slowest, std::abs(machine.x().state().velocity));
      EXPECT_LT(written(kCurrents) >> 8U & 0x1FU, run);
      if (GetParam().isOnSpi()) {
        EXPECT_EQ(written(kGlobalConfiguration) & 4U, 0U) << "it doesn't chop as in SpreadCycle";
        EXPECT_EQ(written(kStallOnSpi), 0x580000U) << "-40 in 7 bits";
      } else {
        EXPECT_EQ(written(kChopsAbove), 0U);
      }
    }
    return false;
  });
  EXPECT_NEAR(slowest, 0.05, 1e-4);
  machine.expectRegistersAsBefore();
  EXPECT_GT(written(kChopsAbove), 0U);
}

// Its detection is for one speed: at another one the motor would press against the block.
TEST_P(StallHoming, ApproachesAtItsSpeedWhateverTheOverride) {
  for (const double factor : {0.01, 0.5, 2.0}) {
    for (const bool in_motion : {false, true}) {
      WithWall machine(stallAxis(GetParam()));
      machine::Machine& all = *machine.bench.machine;
      if (!in_motion) all.setSpeedOverride(factor);
      double fastest = 0.0;
      bool is_changed = false;
      const HomingResult result = machine.x().home([&] {
        fastest = std::max(fastest, std::abs(machine.x().state().velocity));
        if (in_motion && !is_changed && fastest > 0.02) {
          all.setSpeedOverride(factor);
          is_changed = true;
        }
        return false;
      });
      EXPECT_EQ(result.end, HomingEnd::kHomed) << factor << ": " << result.message;
      if (factor < 1.0) {
        EXPECT_NEAR(fastest, 0.05, 1e-4) << factor;
      }
      EXPECT_LT(std::abs(machine.error()), 64.0) << factor;
      machine.expectRegistersAsBefore();
    }
  }
}

TEST_P(StallHoming, IsRefusedOrEndsIfItsSpeedIsBeyondTheLimit) {
  WithWall before(stallAxis(GetParam()));
  axis::AxisLimits slow = before.x().limits();
  slow.max_speed = 0.02;
  before.x().setLimits(slow);
  HomingResult result = before.x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_TRUE(contains(result.message,
                       "its speed is limited to 0.02 m/s, and its stall is detected at 0.05 m/s"))
      << result.message;
  before.expectRegistersAsBefore();
  EXPECT_EQ(before.x().state().position, 0.0);

  for (const double at : {0.02, 0.0499}) {
    WithWall during(stallAxis(GetParam()));
    double fastest = 0.0;
    bool is_limited = false;
    result = during.x().home([&] {
      fastest = std::max(fastest, std::abs(during.x().state().velocity));
      if (!is_limited && fastest > at) {
        during.x().setLimits(slow);
        is_limited = true;
      }
      return false;
    });
    EXPECT_TRUE(is_limited);
    EXPECT_EQ(result.end, HomingEnd::kFailed) << at;
    EXPECT_TRUE(contains(result.message, "its speed is limited to 0.02 m/s")) << result.message;
    during.bench.machine->advance(0.3);
    during.expectRegistersAsBefore();
    EXPECT_EQ(during.x().state().fault, "");
    EXPECT_FALSE(during.x().state().position_valid);
  }
}

// Stopped, disabled, at fault, at an emergency stop, or beyond max_travel: the motor may have lost
// steps at the block.
TEST_P(StallHoming, LeavesNoPositionValidIfItDoesNotSucceed) {
  using End = void (*)(WithWall&);
  const std::vector<End> ends = {[](WithWall& machine) { machine.x().stop(); },
                                 [](WithWall& machine) { machine.x().enable(false); },
                                 [](WithWall& machine) { machine.bench.machine->emergencyStop(); },
                                 [](WithWall& machine) { machine.bench.rig.powerChip("x", false); },
                                 [](WithWall& machine) {
                                   machine.bench.machine->hold();
                                   machine.bench.machine->advance(0.5);
                                   machine.x().stop();
                                 }};
  for (std::size_t i = 0; i < ends.size(); ++i) {
    WithWall machine(stallAxis(GetParam()));
    ASSERT_EQ(machine.x().home().end, HomingEnd::kHomed);
    machine.bench.move(0.0);
    ASSERT_TRUE(machine.x().state().position_valid);
    bool ended = false;
    const HomingResult result = machine.x().home([&] {
      if (ended || std::abs(machine.x().state().velocity) < 0.04) return false;
      ended = true;
      ends[i](machine);
      return false;
    });
    EXPECT_NE(result.end, HomingEnd::kHomed) << i;
    EXPECT_FALSE(machine.x().state().homed) << i;
    EXPECT_FALSE(machine.x().state().position_valid) << i << ": " << result.message;
  }
  WithWall without(stallAxis(GetParam()), 0.1, false);
  without.x().setPosition(0.0);
  EXPECT_EQ(without.x().home().end, HomingEnd::kFailed);
  EXPECT_FALSE(without.x().state().position_valid);
  without.x().setPosition(0.0);
  bool moved = false;
  EXPECT_EQ(without.x().home([&] { return moved = moved || without.x().state().moving; }).end,
            HomingEnd::kCancelled);
  EXPECT_FALSE(without.x().state().position_valid);
}

TEST_P(StallHoming, KeepsItsCurrentToTheEnd) {
  WithWall machine(stallAxis(GetParam()));
  std::string refusal;
  machine.x().home([&] {
    if (!refusal.empty() || !machine.x().state().moving) return false;
    const std::vector<std::uint32_t> now = machine.registers();
    try {
      machine.x().setCurrent(0.5, 0.1);
    } catch (const Error& error) {
      refusal = error.what();
    }
    EXPECT_EQ(machine.registers(), now);
    return false;
  });
  EXPECT_TRUE(contains(refusal, "its current and threshold are those of a homing to a stall"))
      << refusal;
  machine.expectRegistersAsBefore();
}

TEST_P(StallHoming, FailsIfItsStallsAreAtDifferentPlaces) {
  config::AxisConfig config = stallAxis(GetParam());
  config.tmc->stall->threshold = GetParam().isOnSpi() ? -64 : 255;  // each load is a stall
  WithWall machine(config, GetParam().isOnSpi() ? 0.7 : 0.1);
  const HomingResult result = machine.x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed) << result.message;
  EXPECT_TRUE(contains(result.message, "at different places")) << result.message;
  machine.bench.machine->advance(0.3);
  machine.expectRegistersAsBefore();
}

TEST_P(StallHoming, FailsIfTheChipIsLost) {
  WithWall machine(stallAxis(GetParam()));
  bool lost = false;
  const HomingResult result = machine.x().home([&] {
    if (!lost && machine.x().state().moving) machine.bench.rig.powerChip("x", false);
    lost = lost || machine.x().state().moving;
    return false;
  });
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  machine.bench.machine->advance(1.5);
  const char* const cause = GetParam().isOnSpi() ? "answers with zeros only" : "no chip answers";
  EXPECT_TRUE(contains(machine.x().state().fault, cause)) << machine.x().state().fault;
}

// A machine that meets something in a move, by DIAG or by the bus.
class StallFault : public ::testing::TestWithParam<Way> {
 protected:
  static config::AxisConfig axis() {
    config::AxisConfig config = stallAxis(GetParam());
    if (GetParam().isOnSpi()) config.tmc->mode = config::ChopperMode::kSpreadCycle;
    config.tmc->stall_fault.emplace();
    config.tmc->stall_fault->threshold = GetParam().isOnSpi() ? -60 : 60;
    config.tmc->stall_fault->above = 150.0;  // 0.03 m/s
    return config;
  }
};

TEST_P(StallFault, EndsTheMotionWithItsCause) {
  WithWall machine(axis(), 0.2);
  axis::Axis& x = machine.x();
  x.setPosition(0.0);
  const axis::Move move = x.moveTo(-0.09, false, 0.05);
  const double until_the_wall = 1.05;
  machine.bench.machine->advance(until_the_wall);
  EXPECT_EQ(x.state().fault, "");
  double waited = 0.0;
  for (; x.state().moving && waited < 1.5; waited += 0.01) machine.bench.machine->advance(0.01);
  EXPECT_LT(waited, 0.3);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kFault);
  machine.bench.machine->advance(0.1);
  EXPECT_TRUE(contains(x.state().fault, " reports that the motor has stalled")) << x.state().fault;
  EXPECT_TRUE(contains(x.state().remedy, "what blocks the motor")) << x.state().remedy;
  EXPECT_FALSE(x.state().position_valid);
  machine.bench.machine->recover();
  EXPECT_EQ(x.state().fault, "");
  x.wait(x.moveTo(0.01, true));
  EXPECT_EQ(x.state().fault, "");
}

TEST_P(StallFault, IsOnlyAboveItsSpeed) {
  WithWall machine(axis(), 0.2);
  machine.x().setPosition(0.0);
  const axis::Move move = machine.x().moveTo(-0.06, false, 0.025);
  EXPECT_EQ(machine.x().wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(machine.x().state().fault, "");
}

// Loads of up to 40 % of the torque, accelerations and turns are none.
TEST_P(StallFault, IsNoneInSoundMotions) {
  for (const double friction : {0.0, 0.4}) {
    WithWall machine(axis(), friction, false);
    machine.x().setPosition(0.0);
    for (const double place : {-0.09, 0.05, -0.02, 0.09}) machine.bench.move(place);
    const axis::Move turned = machine.x().moveTo(-0.09);
    machine.bench.machine->advance(0.5);
    machine.x().wait(machine.x().moveTo(0.05));
    EXPECT_EQ(machine.x().wait(turned).end, axis::MoveEnd::kReplaced);
    EXPECT_EQ(machine.x().state().fault, "") << friction;
  }
}

TEST_P(StallFault, IsWatchedForAfterAHoming) {
  WithWall machine(axis(), 0.2);
  const HomingResult result = machine.x().home();
  ASSERT_EQ(result.end, HomingEnd::kHomed) << result.message;
  machine.expectRegistersAsBefore();
  if (GetParam().isOnSpi()) {
    EXPECT_EQ(machine.bench.rig.registerOf("x", kStallOnSpi), 0x440000U) << "-60 in 7 bits";
    EXPECT_EQ(machine.bench.rig.registerOf("x", kGlobalConfiguration) & 0x184U, 0x180U);
  } else {
    EXPECT_EQ(machine.bench.rig.registerOf("x", kStallBelow), 60U);
  }
  // A TMC2130 has a faster clock.
  const bool is_2130 = std::string(GetParam().driver) == "tmc2130";
  EXPECT_EQ(machine.bench.rig.registerOf("x", kStallAbove), is_2130 ? 344U : 313U);
}

const std::vector<Way> kStallWays = {{"tmc2209", true},  {"tmc2209", false}, {"tmc2130", true},
                                     {"tmc2130", false}, {"tmc5160", true},  {"tmc5160", false}};

std::string nameOfWay(const ::testing::TestParamInfo<Way>& way) {
  return std::string(way.param.driver) + (way.param.has_diag ? "ByDiag" : "ByTheBus");
}

INSTANTIATE_TEST_SUITE_P(, StallFault, ::testing::ValuesIn(kStallWays), nameOfWay);

// What DIAG reports is named by the registers.
TEST(FaultOutput, OfAChipIsExplainedByItsRegisters) {
  WithWall machine(stallAxis());
  machine.x().setPosition(0.0);
  machine.x().moveTo(-0.04);
  machine.bench.machine->advance(0.2);
  sim::TmcTrouble trouble;
  trouble.over_temperature = true;
  machine.bench.rig.setTrouble("x", trouble);
  machine.bench.machine->advance(0.1);
  EXPECT_TRUE(contains(machine.x().state().fault, "because of over-temperature"))
      << machine.x().state().fault;
}

INSTANTIATE_TEST_SUITE_P(, StallHoming, ::testing::ValuesIn(kStallWays), nameOfWay);

}  // namespace
}  // namespace stepdriver
