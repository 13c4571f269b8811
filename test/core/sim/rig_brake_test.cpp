#include <gtest/gtest.h>

#include "support/constants.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::kMillisecond;

/// A load that falls at 20 mm/s, and a brake that a high level releases.
RigAxisSpec verticalAxis(bool with_brake = true) {
  RigAxisSpec spec = test::plainAxis("a4988");
  spec.load_falls = 20.0;
  if (with_brake) spec.brake = BrakeSpec{"x.brake", true, 60 * kMillisecond, 30 * kMillisecond};
  return spec;
}

/// How far the load has sunk until now.
double fell(HandRig& bench) {
  bench.reads("nothing");
  return bench.report().fell;
}

TEST(RigBrake, WithoutOneTheLoadFallsWhileTheMotorHasNoCurrent) {
  HandRig bench(verticalAxis(false));
  bench.ready();
  const double carriage = bench.report().carriage;
  const double before = fell(bench);
  bench.wait(100 * kMillisecond);
  EXPECT_EQ(fell(bench), before) << "it is energized";
  bench.set("x.enable", true).wait(100 * kMillisecond);
  EXPECT_NEAR(fell(bench) - before, 2.0, 1e-9);
  EXPECT_NEAR(bench.report().carriage, carriage - 2.0, 1e-9);
  bench.set("x.enable", false).wait(100 * kMillisecond);
  EXPECT_NEAR(fell(bench) - before, 2.0, 1e-9);
  EXPECT_NEAR(bench.report().carriage, carriage - 2.0, 0.4001) << "the rotor snaps to its phase";
}

TEST(RigBrake, HoldsTheLoadOnlyAfterItsEngageTime) {
  HandRig bench(verticalAxis());
  bench.request("x.brake", false).ready();
  EXPECT_EQ(fell(bench), 0.0);
  bench.set("x.brake", true).wait(kMillisecond).set("x.brake", false);
  bench.set("x.enable", true).wait(100 * kMillisecond);
  EXPECT_NEAR(fell(bench), 0.6, 1e-9);
  bench.wait(1'000 * kMillisecond);
  EXPECT_NEAR(fell(bench), 0.6, 1e-9);
  bench.set("x.brake", true).wait(10 * kMillisecond);
  EXPECT_NEAR(fell(bench), 0.8, 1e-9) << "it lets go at once";
}

TEST(RigBrake, CountsAStepAgainstItUntilItsReleaseTimeIsOver) {
  HandRig bench(verticalAxis());
  bench.request("x.brake", false).ready().pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepAgainstBrake, 1}}));
  bench.set("x.brake", true).wait(60 * kMillisecond - 1).pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepAgainstBrake, 2}}));
  const double carriage = bench.report().carriage;
  bench.pulse();
  EXPECT_EQ(bench.report().violations, (test::Violations{{Violation::kStepAgainstBrake, 2}}));
  EXPECT_NEAR(bench.report().carriage - carriage, 0.2, 1e-9);
}

TEST(RigBrake, KeepsTheRotorWhereItIsUntilItIsReleased) {
  HandRig bench(verticalAxis());
  bench.request("x.brake", false).ready();
  bench.set("x.brake", true).wait(100 * kMillisecond).pulse(2);
  const double carriage = bench.report().carriage;
  bench.set("x.brake", false).wait(100 * kMillisecond);
  bench.set("x.sleep", false)
      .wait(100 * kMillisecond)
      .set("x.sleep", true)
      .wait(100 * kMillisecond);
  EXPECT_NEAR(bench.report().carriage, carriage, 1e-9) << "its phase is two full steps away";
  bench.set("x.brake", true);
  EXPECT_NEAR(std::abs(bench.report().carriage - carriage), 0.4, 1e-9);
  EXPECT_EQ(fell(bench), 0.0);
}

}  // namespace
}  // namespace stepdriver::sim
