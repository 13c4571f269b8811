#include "stepdriver_core/sim/rig.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::kTravel;
using test::plainAxis;

TEST(Rig, CarriageFollowsTheStepsThatGoOut) {
  HandRig bench("a4988");
  bench.ready().pulse(10).direction(false).pulse(3);
  const RigAxisReport seen = bench.report();
  EXPECT_EQ(seen.pulses_forward, 10);
  EXPECT_EQ(seen.pulses_backward, 3);
  EXPECT_EQ(seen.translator, 7 * 16);
  EXPECT_DOUBLE_EQ(seen.carriage, 7 * kTravel);
  EXPECT_TRUE(seen.energized);
}

TEST(Rig, CarriageStartsWhereTheSpecificationSays) {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.start = -12.5;
  HandRig bench(spec);
  EXPECT_DOUBLE_EQ(bench.report().carriage, -12.5);
  bench.ready().pulse();
  EXPECT_DOUBLE_EQ(bench.report().carriage, -12.5 + kTravel);
}

TEST(Rig, StepIsAsLongAsTheModeOfItsEdge) {
  HandRig bench("drv8825");
  bench.ready().pulse();
  EXPECT_EQ(bench.report().microsteps, 1);
  bench.set("x.ms3", true).wait(1'000);
  EXPECT_EQ(bench.report().microsteps, 1) << "a mode takes effect with the next step";
  bench.pulse();
  EXPECT_EQ(bench.report().microsteps, 16) << "LLH";
  bench.set("x.ms1", true).wait(1'000).pulse();
  EXPECT_EQ(bench.report().microsteps, 32) << "HLH";
  EXPECT_EQ(bench.report().translator, 32 + 2 + 1);
  EXPECT_DOUBLE_EQ(bench.report().carriage, kTravel * (1 + 1.0 / 16 + 1.0 / 32));
}

TEST(Rig, CoarserModeGoesToItsNextPlace) {
  for (const bool forward : {true, false}) {
    HandRig bench("a4988");
    bench.ready().set("x.ms1", true).wait(1'000).pulse();
    ASSERT_EQ(bench.report().translator, 8) << "half a step";
    bench.set("x.ms1", false).direction(forward).pulse();
    EXPECT_EQ(bench.report().translator, forward ? 16 : 0) << "forward: " << forward;
  }
}

TEST(Rig, MicrostepsAreStrappedWhereThePinsAreNotWired) {
  RigAxisSpec spec = plainAxis("drv8825");
  spec.ms1 = spec.ms2 = spec.ms3 = Wire{};
  spec.microsteps = 16;
  HandRig strapped(spec);
  strapped.ready().pulse();
  EXPECT_EQ(strapped.report().translator, 2);

  spec.ms1.line = "x.ms1";
  HandRig one_wired(spec);
  one_wired.ready().set("x.ms1", true).wait(1'000).pulse();
  EXPECT_EQ(one_wired.report().microsteps, 32) << "LLH is strapped, the wire makes it HLH";

  spec = plainAxis("drv8434");
  spec.ms1 = spec.ms2 = Wire{};
  spec.microsteps = 128;
  HandRig floating(spec);
  floating.request("x.step", false).wait(1'000).pulse(128);
  EXPECT_EQ(floating.report().microsteps, 128) << "no code of levels selects that";

  RigAxisSpec module = plainAxis("tb6600");
  module.microsteps = 8;
  HandRig switched(module);
  switched.ready().pulse(8);
  EXPECT_DOUBLE_EQ(switched.report().carriage, kTravel);
}

TEST(Rig, UnwiredPinsLetTheMotorRun) {
  RigAxisSpec spec = plainAxis("drv8825");
  spec.enable = spec.sleep = spec.reset = spec.dir = Wire{};
  HandRig bench(spec);
  bench.request("x.step", false).pulse(2);
  EXPECT_EQ(bench.report().pulses_backward, 2) << "an unwired DIR is low";
  EXPECT_DOUBLE_EQ(bench.report().carriage, -2 * kTravel);
  EXPECT_EQ(bench.report().totalViolations(), 0);
}

TEST(Rig, ChipIsOffUntilItsLinesAreRequested) {
  HandRig bench("drv8825");
  bench.request("x.step", false).pulse();
  EXPECT_FALSE(bench.report().energized);
  EXPECT_EQ(bench.report().translator, 0);
  EXPECT_TRUE(bench.ready().report().energized);
}

TEST(Rig, OnlyTheA4988CountsWhileDisabled) {
  for (const std::string model : {"a4988", "drv8825", "tb6600"}) {
    HandRig bench(model);
    bench.ready().set("x.enable", true).wait(1'000).pulse(1);
    const int finest = driver::driverChip(model).microsteps.back();
    EXPECT_EQ(bench.report().translator, model == "a4988" ? finest : 0)
        << driver::driverChip(model).title;
    EXPECT_FALSE(bench.report().energized);
    EXPECT_DOUBLE_EQ(bench.report().carriage, 0.0) << driver::driverChip(model).title;
  }
}

TEST(Rig, RotorSnapsToTheNearestPlaceWithTheTranslatorsPhase) {
  for (const int counted : {1, 3, 4, 5, 7}) {
    HandRig bench("a4988");
    bench.ready().set("x.enable", true).wait(1'000).pulse(counted).set("x.enable", false);
    const int full_steps = counted - 4 * ((counted + 1) / 4);  // -1, 0 or 1 from the first position
    EXPECT_DOUBLE_EQ(bench.report().carriage, kTravel * full_steps) << counted << " steps";
    EXPECT_EQ(bench.report().translator, 16 * counted);
  }
}

TEST(Rig, ResetAndSleepBringTheTranslatorHome) {
  for (const std::string line : {"x.reset", "x.sleep"}) {
    HandRig bench("a4988");
    bench.ready().pulse(5).set(line, false);
    EXPECT_EQ(bench.report().translator, 4 * 16) << line;
    EXPECT_FALSE(bench.report().energized) << line;
    EXPECT_DOUBLE_EQ(bench.report().carriage, 5 * kTravel) << line << ": no current, no move";
    bench.pulse(2);
    EXPECT_EQ(bench.report().translator, 4 * 16) << line << ": steps are ignored";
    bench.set(line, true).wait(2'000'000);
    EXPECT_TRUE(bench.report().energized) << line;
    EXPECT_DOUBLE_EQ(bench.report().carriage, 4 * kTravel) << line << ": snapped to Home";
    bench.pulse();
    EXPECT_DOUBLE_EQ(bench.report().carriage, 5 * kTravel) << line;
  }
}

TEST(Rig, LosesStepsForGood) {
  HandRig bench("a4988");
  RigFaults faults;
  faults.lose_every = 5;
  bench.rig.setFaults("x", faults);
  bench.ready().pulse(23).direction(false).pulse(1);
  EXPECT_DOUBLE_EQ(bench.report().carriage, (23 - 4 - 1) * kTravel);
  EXPECT_EQ(bench.report().translator, 22 * 16);
  bench.set("x.enable", true).wait(1'000).set("x.enable", false);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 18 * kTravel) << "no snap: the rotor lost nothing";
}

TEST(Rig, HandMovesTheCarriage) {
  HandRig bench("a4988");
  bench.ready().set("x.enable", true);
  bench.rig.placeCarriage("x", 31.45, bench.now);
  EXPECT_DOUBLE_EQ(bench.report().carriage, 31.45);
  EXPECT_EQ(bench.report().pulses_forward, 0);
  bench.set("x.enable", false);
  EXPECT_NEAR(bench.report().carriage, 31.2, 1e-9) << "39 cycles of 0.8 mm";
  bench.rig.placeCarriage("x", 0.5, bench.now);
  EXPECT_NEAR(bench.report().carriage, 0.8, 1e-9) << "against the current";
}

TEST(Rig, SharedLineReachesAllItsPins) {
  RigAxisSpec x = plainAxis("a4988", "x");
  RigAxisSpec y = plainAxis("drv8825", "y");
  x.enable.line = y.enable.line = "all.enable";
  y.enable.inverted = true;
  HandRig bench({x, y});
  bench.ready("x").ready("y").request("all.enable", false);
  EXPECT_TRUE(bench.report("x").energized);
  EXPECT_FALSE(bench.report("y").energized) << "inverted on its way";
  bench.set("all.enable", true);
  EXPECT_FALSE(bench.report("x").energized);
  EXPECT_TRUE(bench.report("y").energized);
  EXPECT_EQ(bench.trace->times("x", "enable", true), bench.trace->times("y", "enable", true));
  EXPECT_EQ(bench.trace->times("x", "enable", true).size(), 1U);
}

TEST(Rig, IgnoresLinesThatItDoesNotKnow) {
  HandRig bench("a4988");
  bench.ready().request("lamp", true).set("lamp", false);
  bench.rig.onRelease(bench.line("lamp"), bench.now);
  EXPECT_FALSE(bench.reads("door"));
  EXPECT_TRUE(bench.trace->edges().empty());
}

TEST(Rig, ReleasedLineKeepsItsLevelAndTheNextRequestMayChangeIt) {
  HandRig bench("a4988");
  bench.ready().pulse(2);
  bench.rig.onRelease(bench.line("x.enable"), bench.now);
  EXPECT_TRUE(bench.report().energized);
  bench.request("x.enable", true);
  EXPECT_FALSE(bench.report().energized);
}

TEST(Rig, WritesFailAsOrdered) {
  HandRig bench("a4988");
  gpio::SimulatedBackend backend(bench.rig, [&] { return bench.now; });
  const auto lines = backend.request({{"x.step", false, false}, {"x.dir", false, false}}, {});
  const gpio::LineWrite high{0, true};
  const gpio::LineWrite low{0, false};
  bench.rig.failWrites("x.step", 2, EIO);
  EXPECT_EQ(lines->write(&high, 1), 0);
  EXPECT_EQ(lines->write(&low, 1), 0);
  EXPECT_EQ(lines->write(&high, 1), EIO);
  EXPECT_EQ(lines->write(&high, 1), EIO);
  const gpio::LineWrite other{1, true};
  EXPECT_EQ(lines->write(&other, 1), 0) << "a fault is one line's";
  bench.rig.clearWriteFault("x.step");
  EXPECT_EQ(lines->write(&high, 1), 0);
  EXPECT_EQ(bench.report().pulses_forward + bench.report().pulses_backward, 2);
}

TEST(Rig, RefusesWhatItCannotBuild) {
  const RigAxisSpec good = plainAxis("a4988");
  EXPECT_EQ(Rig({good}).axes(), (std::vector<std::string>{"x"}));
  EXPECT_THROW(Rig({good, good}), Error);
  RigAxisSpec unknown_mode = good;
  unknown_mode.microsteps = 32;
  EXPECT_THROW(Rig({unknown_mode}), Error);
  RigAxisSpec standing = good;
  standing.full_step_travel = 0.0;
  EXPECT_THROW(Rig({standing}), Error);
}

TEST(Rig, RefusesAxesThatItHasNot) {
  HandRig bench("a4988");
  EXPECT_THROW(bench.rig.report("y"), Error);
  EXPECT_THROW(bench.rig.setFaults("y", {}), Error);
  EXPECT_THROW(bench.rig.placeCarriage("y", 0.0, 0), Error);
}

TEST(Rig, SaysThatAPinThatIsNotWiredHasNoLine) {
  Rig rig({plainAxis("a4988")});
  for (const auto& call : std::vector<std::function<void()>>{
           [&] { rig.failWrites("", 0, EIO); }, [&] { rig.clearWriteFault(""); },
           [&] { rig.stickInput("", true, 0); }, [&] { rig.outputLevel(""); },
           [&] { rig.setInput("", true, 0); }}) {
    try {
      call();
      ADD_FAILURE() << "it was accepted";
    } catch (const Error& error) {
      EXPECT_STREQ(error.what(), "a line of the rig has an empty name, which is that of no line");
    }
  }
}

}  // namespace
}  // namespace stepdriver::sim
