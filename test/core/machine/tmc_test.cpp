#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "bus/open_port.h"
#include "bus/serial_port.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/gantry_bench.h"
#include "support/serial_terminals.h"
#include "support/tmc_axis.h"
#include "support/wired_stream.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::spiAxis;
using test::tmcAxis;
using test::violationsOf;

constexpr int kGconf = 0x00;
constexpr int kIholdIrun = 0x10;
constexpr int kVactual = 0x22;
constexpr int kChopconf = 0x6C;
constexpr int kCoolconf = 0x6D;
constexpr const char* kPort = "/dev/serial0";

std::vector<config::AxisConfig> fourAxes() {
  return {tmcAxis("x", 0), tmcAxis("y", 1), tmcAxis("z", 2), tmcAxis("a", 3)};
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// The message of an action that fails; empty if it succeeds.
std::string failureOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(TmcDrivers, AreSetUpBeforeTheyAreEnabled) {
  Bench bench(fourAxes());
  for (const std::string name : {"x", "y", "z", "a"}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(bench.axis(name).state().fault, "");
    EXPECT_EQ(bench.rig.registerOf(name, kGconf), 0x1C0U);
    EXPECT_EQ(bench.rig.registerOf(name, kVactual), 0U);
    // 0.8 A of at most 0.979 A with 0.11 Ohm and vsense 1: 26 of 32; at rest 13 of 32.
    EXPECT_EQ(bench.rig.registerOf(name, kIholdIrun) & 0x1F1FU, 0x190CU);
    EXPECT_EQ(bench.rig.registerOf(name, kChopconf) >> 24U & 0xFU, 4U);
    bench.move(0.01, name);
    EXPECT_NEAR(bench.report(name).carriage, 10.0, 1e-9);
    EXPECT_EQ(bench.report(name).microsteps, 16);
    EXPECT_EQ(violationsOf(bench.report(name)), "");
    const auto drivers = bench.axis(name).state().drivers;
    ASSERT_TRUE(drivers);
    ASSERT_EQ(drivers->size(), 1U);
    EXPECT_TRUE(drivers->front().is_set_up);
    EXPECT_NEAR(drivers->front().run_current, 0.795, 0.001);
    EXPECT_EQ(drivers->front().retries, 0U);
  }
}

TEST(TmcDrivers, AreSetUpByThreadsToo) {
  Bench bench(fourAxes(), true);
  for (const std::string name : {"x", "y", "z", "a"}) {
    bench.move(0.002, name);
    EXPECT_EQ(bench.axis(name).state().fault, "");
    EXPECT_EQ(violationsOf(bench.report(name)), "");
  }
}

// Twenty times a second, with the place and the speed at which it was measured.
TEST(TmcDrivers, MeasureTheirLoadInMotion) {
  Bench bench({tmcAxis()});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  const auto load = [&x] { return x.state().drivers->front(); };
  x.moveTo(0.09);
  std::vector<double> places;
  while (x.state().moving) {
    const driver::DriverState now = load();
    if (now.stall_guard && (places.empty() || places.back() != now.stall_guard_position)) {
      places.push_back(now.stall_guard_position);
      EXPECT_NEAR(now.stall_guard_position, x.state().planned, 1e-3);
      EXPECT_NEAR(now.stall_guard_velocity, x.state().velocity, 0.02);
    }
    bench.machine->advance(0.005);
  }
  // 0.09 m at 0.1 m/s, with ramps of 0.1 s.
  EXPECT_GE(places.size(), 15U);
  EXPECT_LE(places.size(), 22U);
  EXPECT_TRUE(std::is_sorted(places.begin(), places.end()));
  const std::uint64_t before = load().transactions;
  bench.machine->advance(1.0);
  EXPECT_LE(load().transactions, before + 20) << "not at rest";
}

// The current of the idle timeout, until the next motion; it needn't wait for the register.
TEST(TmcDrivers, GetALowerCurrentWhileTheyAreIdle) {
  config::AxisConfig config = tmcAxis();
  config.idle_timeout = 2.0;
  config.idle_action = config::IdleAction::kLowerCurrent;
  config.tmc->idle_current = 0.1;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  const auto currents = [&bench] { return bench.rig.registerOf("x", kIholdIrun) & 0x1F1FU; };
  x.setPosition(0.0);
  bench.move(0.001);
  bench.machine->advance(1.5);
  EXPECT_FALSE(x.state().idle);
  EXPECT_EQ(currents(), 0x190CU);
  bench.machine->advance(1.0);
  EXPECT_TRUE(x.state().idle);
  EXPECT_TRUE(x.state().enabled);
  EXPECT_TRUE(x.state().position_valid);
  // 0.979 A / 32 for each step of the scale: 3 of them.
  EXPECT_EQ(currents(), 0x1902U);
  EXPECT_NEAR(x.state().drivers->front().hold_current, 0.0918, 1e-4);
  // Another hold current counts from the next motion on.
  x.setCurrent(0.8, 0.3);
  EXPECT_EQ(currents(), 0x1902U);
  const axis::Move move = x.moveTo(0.002);
  EXPECT_NEAR(move.duration, 2.0 * std::sqrt(0.001), 1e-3);
  x.wait(move);
  EXPECT_FALSE(x.state().idle);
  EXPECT_EQ(currents(), 0x1908U);
  // A driver that is set up anew while it is idle, and one that is disabled.
  bench.machine->advance(3.0);
  EXPECT_EQ(currents(), 0x1902U);
  bench.rig.brownOut("x");
  bench.machine->advance(0.5);
  bench.machine->recover();
  bench.machine->advance(0.1);
  EXPECT_EQ(currents(), 0x1902U);
  x.enable(false);
  x.enable(true);
  bench.machine->advance(0.1);
  EXPECT_EQ(currents(), 0x1908U);
  EXPECT_EQ(x.state().fault, "");
}

// A clock that moves from event to event would otherwise never rest.
TEST(TmcDrivers, AreNoReasonForAVirtualClockToGoOn) {
  Bench bench({tmcAxis()}, true);
  bench.axis().setPosition(0.0);
  const pulse::Nanoseconds before = bench.clock.now();
  for (int i = 0; i < 300; ++i) bench.axis().setPosition(0.001 * i);
  EXPECT_EQ(bench.clock.now(), before);
}

TEST(TmcDrivers, AreAskedWhileAVirtualClockMoves) {
  Bench bench({tmcAxis()}, true);
  bench.may_exceed_limits = true;
  bench.axis().setPosition(0.0);
  bench.rig.brownOut("x");
  EXPECT_EQ(bench.axis().wait(bench.axis().moveTo(0.09)).end, axis::MoveEnd::kFault);
  EXPECT_PRED2(has, bench.axis().state().fault, "the TMC2209 was reset");
}

// The outputs of a chip are off while its registers are written, and it may hold a load.
TEST(TmcDrivers, KeepTheirCurrentAtRecoverIfTheyHaveNoFault) {
  config::AxisConfig config = tmcAxis("y", 0);
  config.motor = "left";
  const config::AxisConfig twin = tmcAxis("right", 1);
  config.twins.push_back(static_cast<const config::MotorConfig&>(twin));
  config.twins.front().motor = "right";
  Bench bench({config}, test::rigMotors(config));
  const auto drivers = [&bench] { return *bench.axis("y").state().drivers; };
  bench.machine->advance(0.1);
  const std::uint64_t left = drivers()[0].transactions;
  const std::uint64_t right = drivers()[1].transactions;
  bench.rig.brownOut("y");
  bench.machine->advance(0.2);
  EXPECT_PRED2(has, bench.axis("y").state().fault, "was reset");
  bench.machine->recover();
  EXPECT_EQ(bench.axis("y").state().fault, "");
  EXPECT_TRUE(drivers()[0].is_set_up);
  EXPECT_GT(drivers()[0].transactions, left + 10);
  // At most four reads for each look at it, and no write: to set it up takes more than twenty.
  EXPECT_LE(drivers()[1].transactions, right + 12);
}

TEST(TmcDrivers, MakeTheSameStepsAsDriversWithPins) {
  config::AxisConfig pins = tmcAxis();
  pins.tmc.reset();
  pins.driver = driver::driverChip("tmc2209");
  Bench with({tmcAxis()});
  Bench without({pins});
  with.machine->advance(1.0);
  without.machine->advance(1.0);
  const auto duration = [](Bench& bench) { return bench.move(0.05).duration; };
  EXPECT_EQ(duration(with), duration(without));
  EXPECT_EQ(with.pulses(), without.pulses());
}

TEST(TmcDrivers, ChangeTheirMicrostepsByTheirRegister) {
  Bench bench({tmcAxis()});
  bench.axis().setPosition(0.0);
  for (const int microsteps : {256, 1, 128, 2, 16}) {
    SCOPED_TRACE(microsteps);
    bench.axis().setMicrosteps(microsteps);
    EXPECT_EQ(bench.axis().state().microsteps, microsteps);
    bench.move(0.002);
    EXPECT_NEAR(bench.report().carriage, 2.0, 1e-9);
    bench.move(0.0);
    EXPECT_NEAR(bench.report().carriage, 0.0, 1e-9);
    EXPECT_EQ(bench.report().microsteps, microsteps);
    EXPECT_TRUE(bench.axis().state().position_valid);
  }
  EXPECT_EQ(violationsOf(bench.report()), "");
  EXPECT_TRUE(has(failureOf([&] { bench.axis().setMicrosteps(5); }), "has no 1/5 mode"));
}

TEST(TmcDrivers, GetOtherCurrentsAtRestAndInMotion) {
  Bench bench({tmcAxis()});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  const auto driver = [&x] { return x.state().drivers->front(); };
  const axis::Move move = x.moveTo(0.05);
  bench.machine->advance(0.3);
  x.setCurrent(0.5, 0.1);
  // 0.979 A / 32 for each step of the scale: 16 of them, and 3 at rest.
  EXPECT_EQ(bench.rig.registerOf("x", kIholdIrun) & 0x1F1FU, 0x0F02U);
  EXPECT_NEAR(driver().run_current, 0.4896, 0.0001);
  EXPECT_NEAR(driver().hold_current, 0.0918, 0.0001);
  bench.machine->advance(0.3);
  EXPECT_NEAR(driver().present_current, 0.4896, 0.0001);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kReached);
  bench.machine->advance(1.0);
  EXPECT_NEAR(driver().present_current, 0.0918, 0.0001);
  x.setCurrent(0.3, 0.0);
  EXPECT_NEAR(driver().hold_current, driver().run_current, 1e-9) << "0.4 A is more than 0.3 A";
  // They stay when its registers are written again.
  bench.rig.brownOut("x");
  bench.machine->advance(0.5);
  EXPECT_PRED2(has, failureOf([&] { x.setCurrent(0.5, 0.1); }), "isn't set up");
  bench.machine->recover();
  EXPECT_EQ(bench.rig.registerOf("x", kIholdIrun) & 0x1F1FU, 0x0808U);
  x.setCurrent(0.0, 0.0);
  EXPECT_EQ(bench.rig.registerOf("x", kIholdIrun) & 0x1F1FU, 0x190CU);
}

// The carriage on the rig, whose friction takes a part of the torque, at half of the way.
struct Loaded {
  explicit Loaded(double friction) : bench({tmcAxis()}, specs(friction)) {
    bench.axis().setPosition(0.0);
    bench.axis().moveTo(0.09);
    bench.machine->advance(0.6);
  }
  static std::vector<sim::RigAxisSpec> specs(double friction) {
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({tmcAxis()});
    rig[0].motor.emplace();
    rig[0].motor->holding_torque = 0.5;
    rig[0].motor->friction = friction;
    return rig;
  }
  int stallGuard() { return bench.axis().state().drivers->front().stall_guard.value_or(-1); }

  Bench bench;
};

TEST(TmcDrivers, TellTheLoadOfTheMotor) {
  int before = 511;
  for (const double friction : {0.0, 0.1, 0.2, 0.3}) {
    Loaded loaded(friction);
    const int now = loaded.stallGuard();
    EXPECT_GE(now, 0) << friction;
    EXPECT_LT(now, before) << friction;
    before = now;
  }
  Bench bench({tmcAxis()});
  EXPECT_FALSE(bench.axis().state().drivers->front().stall_guard) << "nothing has moved yet";
}

TEST(TmcDrivers, LoseStepsWithoutEnoughCurrent) {
  Loaded strong(0.2);
  strong.bench.machine->advance(1.0);
  EXPECT_EQ(strong.bench.report().lost_steps, 0);
  Loaded weak(0.2);
  weak.bench.axis().setCurrent(0.25, 0.1);
  weak.bench.machine->advance(1.0);
  EXPECT_GT(weak.bench.report().lost_steps, 0);
}

TEST(TmcDrivers, RefuseCurrentsBeyondWhatIsConfigured) {
  config::AxisConfig pins = tmcAxis("y");
  pins.tmc.reset();
  pins.driver = driver::driverChip("tmc2209");
  Bench bench({tmcAxis(), pins});
  const std::uint32_t before = bench.rig.registerOf("x", kIholdIrun);
  const auto refusal = [&bench](double run, double hold) {
    return failureOf([&] { bench.axis().setCurrent(run, hold); });
  };
  for (const double current : {0.81, -0.1, 0.02, 1e300, test::kNan}) {
    EXPECT_PRED2(has, refusal(current, 0.0), "must be 0 or from 0.0305") << current;
  }
  EXPECT_PRED2(has, refusal(0.0, 0.81), "its run current");
  EXPECT_PRED2(has, refusal(0.3, 0.31), "to 0.3 A, its run current");
  EXPECT_EQ(bench.rig.registerOf("x", kIholdIrun), before);
  EXPECT_PRED2(has, failureOf([&] { bench.axis("y").setCurrent(0.5, 0.5); }), "set by the board");
  bench.axis().setCurrent(0.8, 0.8);
  bench.axis().setCurrent(0.0306, 0.0306);
  EXPECT_EQ(bench.rig.registerOf("x", kIholdIrun) & 0x1F1FU, 0x0000U);
}

TEST(TmcDrivers, AreAtFaultIfTheyDoNotTakeACurrent) {
  Bench bench({tmcAxis()});
  sim::WireFaults faults;
  faults.flipped = 1.0;
  bench.rig.setWireFaults(kPort, faults);
  EXPECT_PRED2(has, failureOf([&] { bench.axis().setCurrent(0.5, 0.1); }), "damaged");
  EXPECT_PRED2(has, bench.axis().state().fault, "damaged");
}

// A hundred thousand pulses, and one that the chip hasn't heard, or has heard twice.
class AuditOfSteps : public ::testing::TestWithParam<std::tuple<bool, bool, bool>> {};

TEST_P(AuditOfSteps, FindsOneInAHundredThousand) {
  const auto [doubled, inverted, on_the_way_back] = GetParam();
  config::AxisConfig config = tmcAxis();
  config.pins.dir.inverted = inverted;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  constexpr int kWays = 26;  // of 4008 pulses
  for (int way = 0; way < kWays; ++way) {
    ASSERT_EQ(x.state().fault, "") << "after " << way << " ways";
    ASSERT_TRUE(x.state().position_valid);
    if (way == kWays - (on_the_way_back ? 1 : 2)) {
      sim::RigFaults faults;
      (doubled ? faults.doubled_pulses : faults.missed_pulses) = 1;
      bench.rig.setFaults("x", faults);
    }
    x.wait(x.moveTo(way % 2 == 0 ? 0.0501 : 0.0));
    if (way == 0) bench.machine->advance(1.5);  // the audit learns in which direction it counts
  }
  EXPECT_GE(bench.report().pulses_forward + bench.report().pulses_backward, 100'000);
  bench.machine->advance(1.5);
  // The way on which it happened led forward, or back.
  EXPECT_PRED2(has, x.state().fault,
               doubled != on_the_way_back
                   ? "the TMC2209 is 1 step ahead of the pulses that were sent"
                   : "the TMC2209 is 1 step behind the pulses that were sent");
  EXPECT_PRED2(has, x.state().remedy, "check the wires to STEP and DIR");
  EXPECT_FALSE(x.state().position_valid);
  bench.machine->recover();
  EXPECT_EQ(x.state().fault, "");
  bench.move(0.01);
  bench.machine->advance(2.0);
  EXPECT_EQ(x.state().fault, "");
}

std::string nameOfAudit(const ::testing::TestParamInfo<AuditOfSteps::ParamType>& info) {
  const auto [doubled, inverted, on_the_way_back] = info.param;
  return std::string(doubled ? "OneExtra" : "OneLost") + (inverted ? "Inverted" : "") +
         (on_the_way_back ? "AtTheEnd" : "Before");
}

INSTANTIATE_TEST_SUITE_P(, AuditOfSteps,
                         ::testing::Combine(::testing::Bool(), ::testing::Bool(),
                                            ::testing::Bool()),
                         nameOfAudit);

TEST(TmcDrivers, AreAuditedInEachModeWhilePinsAndCurrentsChange) {
  Bench bench({tmcAxis("x", 0), tmcAxis("y", 1)});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  for (const int microsteps : {256, 1, 32, 4, 16}) {
    SCOPED_TRACE(microsteps);
    x.setMicrosteps(microsteps);
    bench.machine->advance(1.3);
    x.wait(x.moveTo(0.003));
    bench.machine->advance(1.3);
    x.enable(false);
    bench.machine->advance(1.3);
    x.enable(true);
    x.wait(x.moveTo(0.0));
    bench.machine->advance(1.3);
    EXPECT_EQ(x.state().fault, "");
  }
  sim::RigFaults faults;
  faults.missed_pulses = 3;
  bench.rig.setFaults("x", faults);
  x.wait(x.moveTo(0.003));
  bench.machine->advance(1.3);
  EXPECT_PRED2(has, x.state().fault, "is 3 steps behind the pulses that were sent");
  EXPECT_EQ(bench.axis("y").state().fault, "");
}

TEST(TmcDrivers, StepOnBothEdgesByTheirRegister) {
  config::AxisConfig config = tmcAxis();
  config.driver.both_edges = true;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  const auto both_edges = [&bench] { return bench.rig.registerOf("x", kChopconf) >> 29U & 1U; };
  EXPECT_EQ(both_edges(), 1U);
  for (const int microsteps : {16, 64, 16}) {
    x.setMicrosteps(microsteps);
    EXPECT_EQ(both_edges(), 1U);
    // An odd number of steps, and an even one.
    for (const double place : {0.0100125, 0.0}) {
      bench.move(place);
      bench.machine->advance(1.3);
      EXPECT_NEAR(bench.report().carriage, 1e3 * place, 1e-9);
    }
  }
  EXPECT_EQ(x.state().fault, "");
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(TmcDrivers, ChopAudiblyAboveASpeed) {
  config::AxisConfig config = tmcAxis();
  config.tmc->spread_cycle_above = 250.0;  // 50 mm/s at 5 full steps/mm
  Bench bench({config});
  bench.axis().setPosition(0.0);
  EXPECT_EQ(bench.rig.registerOf("x", 0x13), 188U);  // 12e6 / (256 * 250)
  const auto is_silent_at = [&bench](double velocity, double target) {
    const axis::Move move = bench.axis().moveTo(target, false, velocity);
    bench.machine->advance(0.7);
    const bool silent = bench.axis().state().drivers->front().stealth_chop;
    bench.axis().wait(move);
    return silent;
  };
  EXPECT_TRUE(is_silent_at(0.048, 0.09));
  EXPECT_FALSE(is_silent_at(0.052, 0.0));
  EXPECT_TRUE(is_silent_at(0.048, 0.09));
}

// What its registers say stops the axis as what its fault pin says does.
TEST(TmcDrivers, EndTheStepsAtOnceOrByARamp) {
  for (const bool ramps : {false, true}) {
    config::AxisConfig config = tmcAxis();
    config.fault_ramps = ramps;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    x.setPosition(0.0);
    const axis::Move move = x.moveTo(0.09);
    bench.machine->advance(0.3);
    sim::TmcTrouble trouble;
    trouble.undervoltage = true;
    bench.rig.setTrouble("x", trouble);
    const axis::MoveResult result = x.wait(move);
    EXPECT_EQ(result.end, axis::MoveEnd::kFault);
    EXPECT_EQ(has(result.message, "it stopped too fast"), !ramps) << result.message;
    EXPECT_PRED2(has, x.state().fault, "undervoltage");
    EXPECT_FALSE(x.state().moving);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

class TmcOnSpi : public ::testing::TestWithParam<const char*> {};

TEST_P(TmcOnSpi, IsSetUpAndMovesAsOneOnAUart) {
  Bench bench(
      {spiAxis(GetParam(), "x", "/dev/spidev0.0"), spiAxis(GetParam(), "y", "/dev/spidev0.1")});
  for (const std::string name : {"x", "y"}) {
    axis::Axis& axis = bench.axis(name);
    EXPECT_EQ(axis.state().fault, "");
    axis.setPosition(0.0);
    EXPECT_NEAR(axis.state().drivers->front().run_current, 0.79, 0.015);
    for (const int microsteps : {256, 2, 16}) {
      axis.setMicrosteps(microsteps);
      bench.move(0.01, name);
      bench.machine->advance(1.3);
      EXPECT_NEAR(bench.report(name).carriage, 10.0, 1e-9);
      bench.move(0.0, name);
      bench.machine->advance(1.3);
      EXPECT_EQ(bench.report(name).microsteps, microsteps);
      EXPECT_EQ(axis.state().fault, "");
      EXPECT_TRUE(axis.state().position_valid);
    }
    axis.setCurrent(0.4, 0.1);
    EXPECT_NEAR(axis.state().drivers->front().run_current, 0.39, 0.02);
    EXPECT_EQ(axis.state().drivers->front().retries, 0U);
    EXPECT_EQ(violationsOf(bench.report(name)), "");
  }
}

TEST_P(TmcOnSpi, TellsItsFaults) {
  Bench bench({spiAxis(GetParam())});
  bench.may_exceed_limits = true;
  axis::Axis& x = bench.axis();
  const auto expect_fault = [&](const char* fault, const std::function<void(bool)>& set) {
    x.setPosition(0.0);
    const axis::Move move = x.moveTo(0.09);
    bench.machine->advance(0.1);
    set(true);
    EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kFault) << fault;
    EXPECT_PRED2(has, x.state().fault, fault);
    EXPECT_FALSE(x.state().position_valid);
    set(false);
    bench.machine->recover();
    EXPECT_EQ(x.state().fault, "");
  };
  expect_fault("was reset", [&](bool there) {
    if (there) bench.rig.brownOut("x");
  });
  expect_fault("answers with zeros only", [&](bool there) { bench.rig.powerChip("x", !there); });
  for (const auto& [member, text] :
       {std::pair{&sim::TmcTrouble::over_temperature, "over-temperature"},
        std::pair{&sim::TmcTrouble::short_b, "a short circuit of coil B to ground"},
        std::pair{&sim::TmcTrouble::undervoltage, "undervoltage"}}) {
    expect_fault(text, [&, which = member](bool there) {
      sim::TmcTrouble trouble;
      trouble.*which = there;
      bench.rig.setTrouble("x", trouble);
    });
  }
  x.setPosition(0.0);
  x.wait(x.moveTo(0.0101));
  bench.machine->advance(2.0);
  EXPECT_EQ(x.state().fault, "");
  sim::RigFaults faults;
  faults.missed_pulses = 1;
  bench.rig.setFaults("x", faults);
  x.wait(x.moveTo(0.0));
  bench.machine->advance(2.0);
  EXPECT_PRED2(has, x.state().fault, "is 1 step ");
}

TEST_P(TmcOnSpi, TellsItsLoadInSpreadCycle) {
  config::AxisConfig config = spiAxis(GetParam());
  config.tmc->mode = config::ChopperMode::kSpreadCycle;
  Bench bench({config});
  bench.move(0.05);
  const driver::DriverState driver = bench.axis().state().drivers->front();
  ASSERT_TRUE(driver.stall_guard);
  EXPECT_GT(*driver.stall_guard, 510);
  EXPECT_NEAR(*driver::loadOf(driver), 1.0 - *driver.stall_guard / 1023.0, 1e-12);
  EXPECT_FALSE(driver.stealth_chop);
}

TEST_P(TmcOnSpi, TellsAnotherLoadWithAnotherThreshold) {
  config::AxisConfig config = spiAxis(GetParam());
  config.tmc->mode = config::ChopperMode::kSpreadCycle;
  Bench bench({config});
  const auto load = [&] {
    bench.move(bench.axis().state().position > 0.02 ? 0.0 : 0.05);
    return *bench.axis().state().drivers->front().stall_guard;
  };
  const int before = load();
  bench.axis().setStallThreshold(-20);
  EXPECT_NEAR(load(), before - 160, 30);
  bench.axis().setStallThreshold(63);
  EXPECT_EQ(load(), 1023);
  for (const int refused : {-65, 64}) {
    EXPECT_PRED2(has, failureOf([&] { bench.axis().setStallThreshold(refused); }),
                 "must be from -64 to 63");
  }
  // It is kept when all registers are written again.
  bench.axis().setStallThreshold(-20);
  bench.machine->emergencyStop();
  bench.machine->recover();
  EXPECT_EQ(bench.rig.registerOf("x", kCoolconf) >> 16U & 0x7FU, 128U - 20U);
}

TEST(TmcDrivers, RefuseAStallThresholdThatTheyDoNotUse) {
  Bench bench({tmcAxis()});
  EXPECT_PRED2(has, failureOf([&] { bench.axis().setStallThreshold(50); }),
               "uses a threshold in homings only");
  Bench with_pins({test::linearAxis("x")});
  EXPECT_PRED2(has, failureOf([&] { with_pins.axis().setStallThreshold(50); }),
               "it has no driver with `tmc`");
}

TEST_P(TmcOnSpi, IsNamedIfAnotherChipIsThere) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({spiAxis(GetParam())});
  rig[0].tmc->version = rig[0].tmc->version == 0x11 ? 0x30 : 0x11;
  Bench bench({spiAxis(GetParam())}, rig);
  EXPECT_PRED2(has, bench.axis().state().fault, "on /dev/spidev0.0 says that it is a TMC");
}

INSTANTIATE_TEST_SUITE_P(, TmcOnSpi, ::testing::Values("tmc2130", "tmc5160"));

struct Trouble {
  const char* name;
  std::function<void(sim::Rig&, bool there)> set;
  const char* fault;
  const char* remedy;
  bool is_of_wire = false;  // the chip of y is on the same one
};
class TmcFaults : public ::testing::TestWithParam<Trouble> {};

template <bool sim::TmcTrouble::*member>
void setTrouble(sim::Rig& rig, bool there) {
  sim::TmcTrouble trouble;
  trouble.*member = there;
  rig.setTrouble("x", trouble);
}

// Each stops the axis within 1.5 s, is named with its cause, makes the position doubtful, and stays
// until its cause is gone and recover has written all registers again.
TEST_P(TmcFaults, AreTold) {
  const Trouble& trouble = GetParam();
  Bench bench({tmcAxis("x", 0), tmcAxis("y", 1)});
  // A chip without its registers makes larger steps, until that is known.
  bench.may_exceed_limits = true;
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  const axis::Move move = x.moveTo(0.09);
  bench.machine->advance(0.1);
  trouble.set(bench.rig, true);
  bench.machine->advance(1.5);
  EXPECT_PRED2(has, x.state().fault, trouble.fault);
  EXPECT_PRED2(has, x.state().remedy, trouble.remedy);
  EXPECT_FALSE(x.state().moving);
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kFault);
  EXPECT_EQ(bench.axis("y").state().fault.empty(), !trouble.is_of_wire);
  if (std::string(trouble.name) != "Reset") {
    EXPECT_PRED2(has, failureOf([&] { bench.machine->recover(); }), trouble.fault);
    EXPECT_PRED2(has, x.state().fault, trouble.fault);
  }
  trouble.set(bench.rig, false);
  bench.machine->recover();
  EXPECT_EQ(x.state().fault, "");
  EXPECT_EQ(bench.rig.registerOf("x", kGconf), 0x1C0U);
  EXPECT_EQ(bench.rig.registerOf("x", kChopconf) >> 24U & 0xFU, 4U);
  const double before = bench.report().carriage;
  x.wait(x.moveTo(0.001, true));
  EXPECT_NEAR(bench.report().carriage, before + 1.0, 1e-9);
  bench.machine->advance(1.0);
  EXPECT_EQ(x.state().fault, "");
}

INSTANTIATE_TEST_SUITE_P(
    , TmcFaults,
    ::testing::Values(Trouble{"Reset",
                              [](sim::Rig& rig, bool there) {
                                if (there) rig.brownOut("x");
                              },
                              "the TMC2209 was reset", "motor supply"},
                      Trouble{"OverTemperature", setTrouble<&sim::TmcTrouble::over_temperature>,
                              "over-temperature", "cool"},
                      Trouble{"ShortOfCoilA", setTrouble<&sim::TmcTrouble::short_a>,
                              "a short circuit of coil A to ground", "motor's wires"},
                      Trouble{"ShortOfCoilB", setTrouble<&sim::TmcTrouble::short_b>,
                              "a short circuit of coil B to ground", "motor's wires"},
                      Trouble{"Undervoltage", setTrouble<&sim::TmcTrouble::undervoltage>,
                              "undervoltage", "motor supply"},
                      Trouble{"Silence",
                              [](sim::Rig& rig, bool there) { rig.powerChip("x", !there); },
                              "no chip answers", "PDN_UART"},
                      Trouble{"Noise",
                              [](sim::Rig& rig, bool there) {
                                sim::WireFaults faults;
                                faults.flipped = there ? 1.0 : 0.0;
                                rig.setWireFaults(kPort, faults);
                              },
                              "damaged", "wire", true},
                      Trouble{"UnmeasuredRate",
                              [](sim::Rig& rig, bool there) {
                                sim::WireFaults faults;
                                faults.unmeasured_rate = there;
                                rig.setWireFaults(kPort, faults);
                              },
                              "it can't measure this baud rate", "tmc/baud", true}),
    [](const auto& trouble) { return std::string(trouble.param.name); });

TEST(TmcDrivers, WarnOfHeatAndOpenCoilsWithoutAFault) {
  Bench bench({tmcAxis()});
  sim::TmcTrouble trouble;
  trouble.prewarning = trouble.open_b = true;
  bench.rig.setTrouble("x", trouble);
  bench.machine->advance(0.6);
  EXPECT_EQ(bench.axis().state().fault, "");
  const driver::DriverState driver = bench.axis().state().drivers->front();
  EXPECT_TRUE(driver.temperature_warning);
  EXPECT_EQ(driver.at_least_celsius, 120);
  EXPECT_TRUE(driver.open_load_b);
  EXPECT_FALSE(driver.open_load_a);
}

// A few bytes in a thousand are tried again, and nobody notices.
TEST(TmcDrivers, WorkOnANoisyWire) {
  Bench bench({tmcAxis()});
  sim::WireFaults faults;
  faults.lost = faults.doubled = faults.flipped = 0.001;
  bench.rig.setWireFaults(kPort, faults);
  bench.machine->advance(10.0);
  EXPECT_EQ(bench.axis().state().fault, "");
  EXPECT_GT(bench.axis().state().drivers->front().retries, 0U);
}

std::string faultAtStart(const std::vector<config::AxisConfig>& axes,
                         const std::vector<sim::RigAxisSpec>& rig) {
  Bench bench(axes, rig);
  EXPECT_FALSE(bench.axis().state().enabled);
  return bench.axis().state().fault;
}

TEST(TmcDrivers, NameAWrongAddress) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({tmcAxis()});
  rig[0].tmc->address = 2;
  const std::string fault = faultAtStart({tmcAxis()}, rig);
  EXPECT_PRED2(has, fault, "on /dev/serial0 at address 0, no chip answers");
}

TEST(TmcDrivers, NameTheChipThatIsThere) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({tmcAxis()});
  rig[0].tmc->version = 0x20;
  const std::string fault = faultAtStart({tmcAxis()}, rig);
  EXPECT_PRED2(has, fault, "says that it is a TMC2208 or TMC2225");
}

TEST(TmcDrivers, NameAMissingPort) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({tmcAxis()});
  rig[0].tmc.reset();
  config::AxisConfig axis = tmcAxis();
  axis.tmc->port = "/dev/there/is/none";
  const std::string fault = faultAtStart({axis}, rig);
  EXPECT_PRED2(has, fault, "the serial port /dev/there/is/none can't be opened: there is no such");
}

// Chips behind a terminal, as on hardware. A pulled adapter is a terminal that has gone.
class TmcTerminal : public testing::Test {
 protected:
  TmcTerminal() {
    stream_.add(0);  // before there is the thread that reads it
    terminals_ = std::make_unique<test::SerialTerminals>(
        std::vector<std::string>{kPort},
        [this](const std::string&, const std::uint8_t* bytes, std::size_t count, bool pause) {
          if (pause) stream_.wire.pause();
          return stream_.wire.send(bytes, count);
        });
    config_.tmc->port = terminals_->pathOf(kPort);
  }
  std::vector<sim::RigAxisSpec> rig() const {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config_});
    specs[0].tmc.reset();
    return specs;
  }
  // On a computer without enough time, the terminal's thread may answer too late.
  static void recover(Bench& bench) {
    for (int i = 0; i < 100 && !bench.axis().state().fault.empty(); ++i) {
      failureOf([&bench] { bench.machine->recover(); });
    }
    EXPECT_EQ(bench.axis().state().fault, "");
  }

  test::WiredStream stream_;
  std::unique_ptr<test::SerialTerminals> terminals_;
  config::AxisConfig config_ = tmcAxis();
};

TEST_F(TmcTerminal, IsLeftToAProgramThatHasIt) {
  auto other = std::make_unique<bus::SerialPort>(config_.tmc->port, 115'200);
  Bench bench({config_}, rig());
  EXPECT_PRED2(has, bench.axis().state().fault, "another program uses it");
  other.reset();
  recover(bench);
  EXPECT_TRUE(bench.axis().state().drivers->front().is_set_up);
}

TEST_F(TmcTerminal, ThatIsPulledInMotionStopsTheAxis) {
  Bench bench({config_}, rig());
  recover(bench);
  axis::Axis& x = bench.axis();
  x.enable(true);
  x.setPosition(0.0);
  const axis::Move move = x.moveTo(0.09);
  terminals_.reset();
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kFault);
  EXPECT_PRED2(has, x.state().fault, config_.tmc->port);
  EXPECT_FALSE(x.state().moving);
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_LT(bench.report().carriage, 90.0);
  EXPECT_PRED2(has, failureOf([&bench] { bench.machine->recover(); }), config_.tmc->port);
}

// Both answer alike, and nobody at the other address.
TEST(TmcDrivers, OfWhichTwoHaveOneAddressAreFound) {
  const std::vector<config::AxisConfig> axes{tmcAxis("x", 0), tmcAxis("y", 1)};
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
  rig[1].tmc->address = 0;
  Bench bench(axes, rig);
  EXPECT_PRED2(has, bench.axis("y").state().fault, "at address 1, no chip answers");
}

// As after its reset: the trimmer would set its current. Another master on the wire puts it back.
TEST(TmcDrivers, DoNotLeaveTheirCurrentToVref) {
  Bench bench({tmcAxis("x", 0), tmcAxis("y", 1)});
  EXPECT_EQ(bench.rig.registerOf("x", kGconf) & 1U, 0U);
  bench.axis().setPosition(0.0);
  bus::openPort(kPort, 115'200, bench.backend.simulatedSerial(kPort))
      ->writeUnchecked(0, kGconf, 0x1C1);
  bench.machine->advance(1.5);
  EXPECT_PRED2(has, bench.axis().state().fault, "VREF sets its current now");
  EXPECT_PRED2(has, bench.axis().state().remedy, "call recover");
  EXPECT_EQ(bench.axis("y").state().fault, "");
  bench.machine->recover();
  EXPECT_EQ(bench.axis().state().fault, "");
  EXPECT_EQ(bench.rig.registerOf("x", kGconf), 0x1C0U);
}

TEST(TmcDrivers, ShareASlowPort) {
  std::vector<config::AxisConfig> axes = fourAxes();
  for (config::AxisConfig& axis : axes) axis.tmc->baud = 9600;
  Bench bench(axes);
  bench.machine->advance(2.0);
  for (const std::string name : {"x", "y", "z", "a"}) {
    EXPECT_EQ(bench.axis(name).state().fault, "");
    bench.move(0.01, name);
  }
}

TEST(TmcDrivers, AreLeftAloneWhileTheyHaveNoPowerAndSetUpWhenItComes) {
  machine::MachineOptions options;
  options.motor_power.emplace();
  options.motor_power->line = "power";
  options.motor_power->on_ns = 200'000'000;
  config::AxisConfig config = tmcAxis();
  config.enable_on_start = false;
  Bench bench({config}, Bench::rigAxes({config}), false, 0.0, options);
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.axis().state().fault, "");
  EXPECT_FALSE(bench.axis().state().drivers->front().is_set_up);
  bench.axis().enable(true);
  EXPECT_TRUE(bench.axis().state().drivers->front().is_set_up);
  bench.move(0.001);
  EXPECT_NEAR(bench.report().carriage, 1.0, 1e-9);
  bench.machine->emergencyStop();
  bench.machine->advance(1.0);
  EXPECT_FALSE(bench.axis().state().drivers->front().is_set_up);
  bench.machine->recover();
  EXPECT_EQ(bench.axis().state().fault, "");
  bench.axis().enable(true);
  EXPECT_TRUE(bench.axis().state().drivers->front().is_set_up);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

}  // namespace
}  // namespace stepdriver
