#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "stepdriver_core/sim/rig.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::kTravel;
using test::plainAxis;

/// A max switch at 1 mm and a min switch at -1 mm: 5 full steps in either direction.
RigAxisSpec axisWithSwitches() {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.max_switch.emplace();
  spec.max_switch->line = "x.max";
  spec.max_switch->active_level = true;
  spec.max_switch->position = 1.0;
  spec.min_switch.emplace();
  spec.min_switch->line = "x.min";
  spec.min_switch->position = -1.0;
  return spec;
}

TEST(RigSwitch, IsPressedFromItsPositionOnOutwards) {
  HandRig bench(axisWithSwitches());
  bench.ready().pulse(4);
  EXPECT_FALSE(bench.report().max_pressed) << bench.report().carriage;
  bench.pulse();
  EXPECT_TRUE(bench.report().max_pressed) << bench.report().carriage;
  EXPECT_TRUE(bench.reads("x.max"));
  bench.direction(false).pulse();
  EXPECT_FALSE(bench.report().max_pressed) << bench.report().carriage;
  bench.pulse(8);
  EXPECT_FALSE(bench.report().min_pressed) << bench.report().carriage;
  EXPECT_TRUE(bench.reads("x.min")) << "its line is low while it is pressed";
  bench.pulse();
  EXPECT_TRUE(bench.report().min_pressed) << bench.report().carriage;
  EXPECT_FALSE(bench.reads("x.min"));
}

TEST(RigSwitch, IsReleasedFurtherInside) {
  RigAxisSpec spec = axisWithSwitches();
  spec.max_switch->hysteresis = 0.4;
  HandRig bench(spec);
  bench.ready().pulse(6).direction(false);
  for (const int full_steps : {5, 4, 3}) {
    bench.pulse();
    EXPECT_TRUE(bench.report().max_pressed) << full_steps * kTravel << " mm";
  }
  bench.pulse();
  EXPECT_FALSE(bench.report().max_pressed) << 2 * kTravel << " mm";
  bench.direction(true).pulse(2);
  EXPECT_FALSE(bench.report().max_pressed) << 4 * kTravel << " mm, from inside";
}

TEST(RigSwitch, MayBePressedFromTheStart) {
  RigAxisSpec spec = axisWithSwitches();
  spec.start = -1.0;
  HandRig bench(spec);
  EXPECT_TRUE(bench.report().min_pressed);
  EXPECT_FALSE(bench.reads("x.min"));
}

TEST(RigSwitch, BouncesAfterEachChangeAndSettles) {
  RigAxisSpec spec = axisWithSwitches();
  spec.max_switch->bounces = 2;
  spec.max_switch->bounce_ns = 100;
  HandRig bench(spec);
  bench.ready().pulse(4).set("x.step", true);
  const std::int64_t hit = bench.now;
  std::string levels;
  for (const std::int64_t after : {0, 99, 100, 199, 200, 299, 300, 399, 400, 5'000}) {
    levels += bench.rig.inputLevel(bench.line("x.max"), hit + after) ? '1' : '0';
  }
  EXPECT_EQ(levels, "1100110011");
  EXPECT_EQ(bench.trace->times("x", "endstop_max", true),
            (std::vector<std::int64_t>{hit, hit + 200, hit + 400}));
  EXPECT_EQ(bench.trace->times("x", "endstop_max", false),
            (std::vector<std::int64_t>{hit + 100, hit + 300}));
}

TEST(RigSwitch, StartsToBounceAnewWhenItChangesWhileBouncing) {
  RigAxisSpec spec = axisWithSwitches();
  spec.max_switch->bounces = 3;
  spec.max_switch->bounce_ns = 1'000;
  HandRig bench(spec);
  bench.ready();
  bench.set("x.enable", true);
  bench.rig.placeCarriage("x", 1.0, bench.now);
  const std::int64_t pressed = bench.now;
  bench.wait(2'500);
  bench.rig.placeCarriage("x", 0.0, bench.now);
  EXPECT_FALSE(bench.reads("x.max"));
  bench.wait(20'000);
  EXPECT_FALSE(bench.reads("x.max"));
  EXPECT_EQ(bench.trace->times("x", "endstop_max", true),
            (std::vector<std::int64_t>{pressed, pressed + 2'000, pressed + 3'500, pressed + 5'500,
                                       pressed + 7'500}));
}

TEST(RigSwitch, StaysStuckWhateverTheCarriageDoes) {
  HandRig bench(axisWithSwitches());
  RigFaults faults;
  faults.max_stuck = false;
  faults.min_stuck = true;
  bench.rig.setFaults("x", faults);
  bench.ready().pulse(10);
  EXPECT_FALSE(bench.reads("x.max"));
  EXPECT_FALSE(bench.reads("x.min")) << "stuck active, and that is low";
  EXPECT_TRUE(bench.report().min_pressed);
  EXPECT_EQ(bench.report().totalViolations(), 0) << "a switch that says nothing isn't run into";
  bench.rig.setFaults("x", {});
  EXPECT_TRUE(bench.reads("x.max"));
  EXPECT_TRUE(bench.reads("x.min"));
}

TEST(RigSwitch, CountsStepsTowardsItWhileItReadsActive) {
  HandRig bench(axisWithSwitches());
  bench.ready().pulse(5);
  EXPECT_EQ(bench.report().totalViolations(), 0) << "the step that presses it is none";
  bench.pulse(2);
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepIntoSwitch, 2}}));
  bench.direction(false).pulse(12);
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepIntoSwitch, 2}}))
      << "away from it is free; " << bench.report().carriage << " mm";
  bench.pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepIntoSwitch, 3}}))
      << "the min switch blocks the other direction; " << bench.report().carriage << " mm";
}

// Nobody can read a switch and step at the same instant.
TEST(RigSwitch, CountsNoStepIfItIsPressedBetweenTheReadingAndTheStep) {
  HandRig bench(axisWithSwitches());
  RigFaults pressed;
  pressed.max_stuck = true;
  bench.ready().pulse(2);
  EXPECT_FALSE(bench.reads("x.max"));
  bench.rig.setFaults("x", pressed);
  bench.pulse();
  EXPECT_EQ(bench.report().totalViolations(), 0);
  bench.pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepIntoSwitch, 1}}))
      << "it wasn't read before this step";
  EXPECT_TRUE(bench.reads("x.max"));
  bench.pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepIntoSwitch, 2}}));
}

/// The axes x and y of a CoreXY, y with a max switch that 7 full steps press.
struct CoreXyRig : HandRig {
  CoreXyRig()
      : HandRig(axes(), {{{"x", "y"}, {{1.0, 1.0}, {1.0, -1.0}}, {{0.5, 0.5}, {0.5, -0.5}}}}) {
    ready().ready("y");
  }

  static std::vector<RigAxisSpec> axes() {
    std::vector<RigAxisSpec> specs{plainAxis("a4988"), plainAxis("a4988", "y")};
    specs[1].max_switch.emplace();
    specs[1].max_switch->line = "y.max";
    specs[1].max_switch->active_level = true;
    specs[1].max_switch->position = 7 * kTravel;
    return specs;
  }

  /// Both motors make a full step, x.dir's forward.
  void step(bool y_forward) {
    wait(kHalf).set("x.dir", true).set("y.dir", y_forward).wait(kHalf);
    pulse().pulse(1, "y.step");
  }
  void moveY(int full_steps) {
    for (int i = 0; i < full_steps; ++i) step(false);
  }
};

// Without its current the translator goes home, and the rotors then snap by a full step, outwards.
TEST(RigSwitch, OfAxesThatShareMotorsCountsOnlySteps) {
  CoreXyRig bench;
  bench.moveY(7);
  EXPECT_TRUE(bench.reads("y.max"));
  for (const bool awake : {false, true}) bench.set("x.sleep", awake).set("y.sleep", awake);
  EXPECT_NEAR(bench.report("y").carriage, 8 * kTravel, 1e-9);
  bench.wait(1'000'000'000);
  bench.step(true);
  EXPECT_EQ(test::inWords(bench.report("y").violations), "none") << "x moves, and y doesn't";
  EXPECT_NEAR(bench.report("x").carriage, kTravel, 1e-9);
  bench.moveY(3);
  EXPECT_GT(bench.report("y").totalViolations(), 0) << bench.report("y").carriage << " mm";
}

TEST(RigSwitch, SharesALineWithAnother) {
  RigAxisSpec spec = axisWithSwitches();
  spec.min_switch->line = spec.max_switch->line = "x.both";
  spec.min_switch->active_level = spec.max_switch->active_level = false;
  HandRig bench(spec);
  EXPECT_TRUE(bench.ready().reads("x.both"));
  EXPECT_FALSE(bench.pulse(5).reads("x.both"));
  EXPECT_TRUE(bench.direction(false).pulse(5).reads("x.both"));
  EXPECT_FALSE(bench.pulse(5).reads("x.both"));
}

TEST(RigSwitch, TellsWhoWatchesItsLineOfEachChangeOnce) {
  RigAxisSpec spec = axisWithSwitches();
  spec.max_switch->bounces = 3;
  spec.max_switch->bounce_ns = 1'000'000'000;
  HandRig bench(spec);
  bench.ready().pulse(4);
  std::vector<bool> told;
  bench.rig.watchInput(bench.line("x.max"),
                       [&](bool level, std::int64_t) { told.push_back(level); });
  EXPECT_EQ(told, std::vector<bool>{}) << "nothing has changed yet";
  bench.pulse(3);
  EXPECT_EQ(told, std::vector<bool>{true}) << "of the press, and not of the bounces after it";
  bench.direction(false).pulse(3);
  EXPECT_EQ(told, (std::vector<bool>{true, false}));
  bench.rig.watchInput(bench.line("x.max"), nullptr);
  bench.direction(true).pulse(3);
  EXPECT_EQ(told.size(), 2U) << "told after the watch has ended";
}

}  // namespace
}  // namespace stepdriver::sim
