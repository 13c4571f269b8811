#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/constants.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::kMillisecond;
using test::kSecond;
using test::kTravel;
using test::plainAxis;

constexpr double kCycle = 4 * kTravel;

/// An A4988 in full steps, with a common motor.
RigAxisSpec axisWithMotor(const MotorSpec& motor = {}) {
  RigAxisSpec spec = plainAxis("a4988");
  spec.motor = motor;
  return spec;
}

/// Full steps at a rate, at once.
void turn(HandRig& bench, int steps, std::int64_t interval_ns) {
  for (int i = 0; i < steps; ++i) {
    bench.set("x.step", true).wait(interval_ns / 2).set("x.step", false).wait(interval_ns / 2);
  }
}

TEST(RigMotor, ThatFollowsLosesNothingAndRestsWhereTheFieldIs) {
  HandRig bench(axisWithMotor());
  bench.ready();
  turn(bench, 400, 5 * kMillisecond);
  bench.direction(false);
  turn(bench, 100, 5 * kMillisecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 300 * kTravel);
  EXPECT_EQ(bench.report().lost_steps, 0);
  EXPECT_GE(bench.report().largest_lag, 90.0) << "a full step is 90 degrees";
  EXPECT_LT(bench.report().largest_lag, 130.0);
}

TEST(RigMotor, IsntNeeded) {
  HandRig bench(plainAxis("a4988"));
  bench.ready();
  turn(bench, 400, 2'000);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 400 * kTravel);
  EXPECT_EQ(bench.report().largest_lag, 0.0);
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, LosesStepsInABurstAndTheCarriageIsThere) {
  HandRig bench(axisWithMotor());
  bench.ready();
  turn(bench, 400, 20'000);
  bench.wait(2 * kSecond).reads("nothing");
  const RigAxisReport seen = bench.report();
  EXPECT_EQ(seen.pulses_forward, 400);
  EXPECT_DOUBLE_EQ(seen.largest_lag, 180.0);
  EXPECT_GT(seen.lost_steps, 100);
  EXPECT_EQ(seen.lost_steps % 4, 0);
  const double cycles = (400 * kTravel - seen.carriage) / kCycle;
  EXPECT_GT(cycles, 25.0);
  EXPECT_NEAR(cycles, std::round(cycles), 1e-9) << seen.carriage << " mm";
  bench.wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, seen.carriage) << "it is at rest there";
  bench.direction(false);
  turn(bench, 40, 5 * kMillisecond);
  EXPECT_NEAR(bench.report().carriage, seen.carriage - 40 * kTravel, 1e-9) << "it follows again";
}

TEST(RigMotor, ThatRunsOnAfterTheLastStepTakesItsCarriageOntoASwitch) {
  MotorSpec motor;
  motor.damping = 0.01;
  RigAxisSpec spec = axisWithMotor(motor);
  spec.max_switch.emplace();
  spec.max_switch->line = "x.max";
  spec.max_switch->active_level = true;
  // Up to three times the speed that it can stop from.
  const double acceleration = 40'000.0;  // full steps/s^2
  const double top = 4'500.0;            // full steps/s
  const int steps = static_cast<int>(top * top / 2.0 / acceleration) / 4 * 4;
  spec.max_switch->position = (steps + 2) * kTravel;
  HandRig bench(spec);
  bench.ready();
  const std::int64_t begin = bench.now;
  for (int i = 1; i <= steps; ++i) {
    bench.now = begin + std::llround(std::sqrt(2.0 * i / acceleration) * 1e9);
    bench.set("x.step", true).wait(20'000).set("x.step", false);
  }
  EXPECT_EQ(bench.report().lost_steps, 0) << bench.report().largest_lag;
  EXPECT_FALSE(bench.reads("x.max"));
  bench.wait(kSecond);
  EXPECT_TRUE(bench.reads("x.max"));
  EXPECT_GT(bench.report().lost_steps, 0);
  EXPECT_GT(bench.report().carriage, steps * kTravel + 1e-6);
}

// Two full steps away, as far as such a place can be.
TEST(RigMotor, SwingsIntoThePlaceOfItsPhaseWhenCurrentComes) {
  HandRig bench(axisWithMotor());
  bench.ready();
  turn(bench, 6, 5 * kMillisecond);
  const double lag = bench.report().largest_lag;
  for (const bool awake : {false, true}) bench.set("x.sleep", awake).wait(10 * kMillisecond);
  EXPECT_NEAR(std::abs(bench.report().carriage - 6 * kTravel), 2 * kTravel, 1e-9);
  EXPECT_EQ(bench.report().largest_lag, lag) << "that is no lag behind steps";
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, StandsStillWithoutCurrent) {
  HandRig bench(axisWithMotor());
  bench.ready();
  turn(bench, 40, kMillisecond);
  bench.set("x.enable", true);
  const double carriage = bench.report().carriage;
  turn(bench, 4, kMillisecond);
  bench.wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, carriage);
  bench.set("x.enable", false).wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, carriage) << "the A4988 has counted a cycle";
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, StandsStillWhileItsBrakeIsEngaged) {
  RigAxisSpec spec = axisWithMotor();
  spec.brake = BrakeSpec{"x.brake", true, 0, 0};
  HandRig bench(spec);
  bench.request("x.brake", true).ready();
  turn(bench, 40, kMillisecond);
  const double carriage = bench.report().carriage;
  bench.set("x.brake", false).wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, carriage) << "the brake stops what swings";
  bench.set("x.brake", true).wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, carriage);
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, StandsStillAfterAFaultOfItsChip) {
  HandRig bench(axisWithMotor());
  RigFaults faults;
  faults.chip_fault_after = 30;
  bench.ready();
  bench.rig.setFaults("x", faults);
  turn(bench, 40, kMillisecond);
  bench.wait(kSecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 30 * kTravel);
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, FollowsAChangeOfTheMicrosteps) {
  HandRig bench(axisWithMotor());
  bench.ready();
  for (const char* pin : {"x.ms1", "x.ms2", "x.ms3"}) bench.set(pin, true);
  bench.wait(kMillisecond);
  turn(bench, 160, kMillisecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 10 * kTravel);
  EXPECT_LT(bench.report().largest_lag, 10.0) << "a microstep is 5.6 degrees";
  for (const char* pin : {"x.ms1", "x.ms2", "x.ms3"}) bench.set(pin, false);
  bench.wait(kMillisecond);
  turn(bench, 10, 5 * kMillisecond);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 20 * kTravel);
  EXPECT_GE(bench.report().largest_lag, 90.0);
  EXPECT_EQ(bench.report().lost_steps, 0);
}

TEST(RigMotor, SwingsIntoTheNearestPlaceIfItIsTurnedByHand) {
  HandRig bench(axisWithMotor());
  bench.ready();
  turn(bench, 8, 5 * kMillisecond);
  const double lag = bench.report().largest_lag;
  bench.rig.placeCarriage("x", 13.5 * kTravel, bench.now);
  bench.wait(kSecond);
  EXPECT_NEAR(bench.report().carriage, 12 * kTravel, 1e-9);
  EXPECT_EQ(bench.report().largest_lag, lag);
  EXPECT_EQ(bench.report().lost_steps, 0) << "a hand did that";
}

TEST(RigMotor, OfACoreXyMovesBothCarriagesWhenItLosesSteps) {
  std::vector<RigAxisSpec> specs{axisWithMotor(), axisWithMotor()};
  specs[1] = plainAxis("a4988", "y");
  specs[1].motor = MotorSpec{};
  HandRig bench(specs, {{{"x", "y"}, {{1.0, 1.0}, {1.0, -1.0}}, {{0.5, 0.5}, {0.5, -0.5}}}});
  bench.ready().ready("y");
  turn(bench, 400, 20'000);
  bench.wait(2 * kSecond).reads("nothing");
  const double lost = 400 * kTravel - 2.0 * bench.report("x").carriage;
  EXPECT_GT(lost, 20 * kCycle);
  EXPECT_NEAR(lost / kCycle, std::round(lost / kCycle), 1e-9);
  EXPECT_NEAR(bench.report("x").carriage, bench.report("y").carriage, 1e-9);
  EXPECT_GT(bench.report("x").lost_steps, 0);
  EXPECT_EQ(bench.report("y").lost_steps, 0);
}

}  // namespace
}  // namespace stepdriver::sim
