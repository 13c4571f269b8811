#include "driver/tmc_registers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stepdriver::driver::tmc {
namespace {

// The table of the datasheet: IRUN 31, vsense 0.
TEST(TmcCurrent, IsThatOfTheDatasheet) {
  EXPECT_NEAR(highestCurrent(0.10), 1.92, 0.01);
  EXPECT_NEAR(highestCurrent(0.12), 1.64, 0.01);
  EXPECT_NEAR(highestCurrent(0.15), 1.35, 0.01);
}

TEST(TmcCurrent, IsNeverAboveTheWantedOneAndAtMostAStepBelow) {
  for (const double resistor : {0.05, 0.075, 0.11, 0.15, 1.0}) {
    const double least = lowestCurrent(resistor);
    const double most = highestCurrent(resistor);
    for (double wanted = least; wanted <= most; wanted += (most - least) / 997) {
      const CurrentScale scale = scaleOf(wanted, wanted, resistor);
      const double made = currentOf(scale.run, scale.fine, resistor);
      const double step = currentOf(0, scale.fine, resistor);
      ASSERT_LE(made, wanted * (1.0 + 1e-8)) << resistor << " Ohm, " << wanted << " A";
      ASSERT_GT(made, wanted - step - 1e-12) << resistor << " Ohm, " << wanted << " A";
    }
  }
}

TEST(TmcCurrent, TakesTheFinerRangeWhereItReaches) {
  const double fine = currentOf(31, true, 0.11);
  EXPECT_TRUE(scaleOf(fine, 0.2, 0.11).fine);
  EXPECT_EQ(scaleOf(fine, 0.2, 0.11).run, 31);
  EXPECT_FALSE(scaleOf(fine * 1.001, 0.2, 0.11).fine);
}

// A current that was computed from a scale gives that scale again.
TEST(TmcCurrent, KeepsEachOfItsSteps) {
  for (const double resistor : {0.05, 0.11, 0.15}) {
    for (int scale = 0; scale < 32; ++scale) {
      EXPECT_EQ(
          scaleOf(currentOf(scale, true, resistor), currentOf(0, true, resistor), resistor).run,
          scale);
    }
  }
}

TEST(TmcRegisters, HaveEachPowerOfTwoAsMicrosteps) {
  EXPECT_EQ(mresOf(256), 0U);
  EXPECT_EQ(mresOf(16), 4U);
  EXPECT_EQ(mresOf(1), 8U);
  EXPECT_FALSE(mresOf(5));
  EXPECT_FALSE(mresOf(512));
}

TEST(TmcRegisters, AreWrittenWithTheOutputsOffUntilTheEnd) {
  Settings settings;
  settings.current = {20, 10, true};
  const auto all = setUpOf(settings, 16);
  bool on = false;
  for (const RegisterValue& value : all) {
    EXPECT_FALSE(on) << "register " << int{value.number} << " after the outputs are on";
    if (value.number == kChopconf) on = (value.value & kToff) != 0;
    if (value.number == kVactual) {
      EXPECT_EQ(value.value, 0U);
    }
  }
  EXPECT_TRUE(on);
  EXPECT_EQ(all.back().value >> kMresShift & 0xFU, 4U);
  EXPECT_NE(all.back().value & kVsense, 0U);
}

TEST(TmcRegisters, NameNoStallGuardOfATmc2208) {
  Settings settings;
  settings.has_stall_guard = false;
  for (const RegisterValue& value : setUpOf(settings, 1)) EXPECT_NE(value.number, kSgthrs);
}

TEST(TmcRegisters, DelayTheHoldCurrentByUnitsOf22Milliseconds) {
  EXPECT_EQ(powerDownOf(0.0), 2U);
  EXPECT_EQ(powerDownOf(0.437), 20U);
  EXPECT_EQ(powerDownOf(longestHoldDelay()), 255U);
}

}  // namespace
}  // namespace stepdriver::driver::tmc
