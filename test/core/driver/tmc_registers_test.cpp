#include "driver/tmc_registers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>

namespace stepdriver::driver::tmc {
namespace {

constexpr CurrentRange kFine{true};

Board tmc2209(double sense_resistor) { return {Model::kTmc2209, sense_resistor}; }

// The tables of the datasheets: IRUN 31, vsense 0, GLOBALSCALER 256.
TEST(TmcCurrent, IsThatOfTheDatasheet) {
  EXPECT_NEAR(highestCurrent(tmc2209(0.10)), 1.92, 0.01);
  EXPECT_NEAR(highestCurrent(tmc2209(0.12)), 1.64, 0.01);
  EXPECT_NEAR(highestCurrent(tmc2209(0.15)), 1.35, 0.01);
  EXPECT_NEAR(highestCurrent({Model::kTmc2130, 0.15}), 1.33, 0.01);
  EXPECT_NEAR(highestCurrent({Model::kTmc2130, 0.10}), 1.89, 0.01);
  EXPECT_NEAR(highestCurrent({Model::kTmc5160, 0.05}), 4.60, 0.01);
  EXPECT_NEAR(highestCurrent({Model::kTmc5160, 0.075}), 3.06, 0.01);
  EXPECT_NEAR(highestCurrent({Model::kTmc5160, 0.22}), 1.04, 0.01);
}

// The scaler is a 256th of the highest current, and not below 32.
TEST(TmcCurrent, TakesTheLowestScalerThatReachesIt) {
  const Board board{Model::kTmc5160, 0.075};
  const double most = highestCurrent(board);
  for (double wanted = lowestCurrent(board); wanted <= most; wanted += most / 997) {
    const CurrentScale scale = scaleOf(wanted, wanted, board);
    EXPECT_GE(scale.range.global_scaler, 32);
    EXPECT_LE(scale.range.global_scaler, 256);
    const double made = currentOf(scale.run, scale.range, board);
    ASSERT_LE(made, wanted * (1.0 + 1e-8)) << wanted << " A";
    // Below 32 parts of 256 the scale has to do it, in steps of 1/256 of the highest current.
    ASSERT_GT(made, wanted - most / 256 * (1.0 + 1e-9)) << wanted << " A";
  }
  EXPECT_EQ(scaleOf(most, 0.1, board).range.global_scaler, 256);
  EXPECT_EQ(scaleOf(most / 2, 0.1, board).range.global_scaler, 128);
  EXPECT_EQ(scaleOf(most / 2, 0.1, board).run, 31);
}

TEST(TmcCurrent, IsNeverAboveTheWantedOneAndAtMostAStepBelow) {
  for (const double resistor : {0.05, 0.075, 0.11, 0.15, 1.0}) {
    const double least = lowestCurrent(tmc2209(resistor));
    const double most = highestCurrent(tmc2209(resistor));
    for (double wanted = least; wanted <= most; wanted += (most - least) / 997) {
      const CurrentScale scale = scaleOf(wanted, wanted, tmc2209(resistor));
      const double made = currentOf(scale.run, scale.range, tmc2209(resistor));
      const double step = currentOf(0, scale.range, tmc2209(resistor));
      ASSERT_LE(made, wanted * (1.0 + 1e-8)) << resistor << " Ohm, " << wanted << " A";
      ASSERT_GT(made, wanted - step - 1e-12) << resistor << " Ohm, " << wanted << " A";
    }
  }
}

TEST(TmcCurrent, TakesTheFinerRangeWhereItReaches) {
  const double fine = currentOf(31, kFine, tmc2209(0.11));
  EXPECT_TRUE(scaleOf(fine, 0.2, tmc2209(0.11)).range.fine);
  EXPECT_EQ(scaleOf(fine, 0.2, tmc2209(0.11)).run, 31);
  EXPECT_FALSE(scaleOf(fine * 1.001, 0.2, tmc2209(0.11)).range.fine);
}

// A current that was computed from a scale gives that scale again.
TEST(TmcCurrent, KeepsEachOfItsSteps) {
  for (const double resistor : {0.05, 0.11, 0.15}) {
    for (int scale = 0; scale < 32; ++scale) {
      const Board board = tmc2209(resistor);
      EXPECT_EQ(scaleOf(currentOf(scale, kFine, board), currentOf(0, kFine, board), board).run,
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
  settings.current = {20, 10, kFine};
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
  settings.model = Model::kTmc2208;
  for (const RegisterValue& value : setUpOf(settings, 1)) EXPECT_NE(value.number, kSgthrs);
}

TEST(TmcRegisters, OfAChipOnSpiHaveTheirOwnBits) {
  const auto value_of = [](const Settings& settings, std::uint8_t number) {
    std::optional<std::uint32_t> last;
    for (const RegisterValue& value : setUpOf(settings, 16)) {
      EXPECT_NE(value.number, kSlaveconf);
      if (value.number == number) last = value.value;
    }
    return last;
  };
  Settings settings;
  settings.model = Model::kTmc2130;
  settings.current = {20, 10, kFine};
  EXPECT_EQ(value_of(settings, kGconf), 0x24U);  // en_pwm_mode, diag0_error
  EXPECT_EQ(value_of(settings, kChopconf), 0x140300C3U);
  EXPECT_FALSE(value_of(settings, kGlobalScaler));
  settings.spread_cycle = true;
  EXPECT_EQ(value_of(settings, kGconf), 0x20U);
  settings.model = Model::kTmc5160;
  settings.current = {31, 15, CurrentRange{false, 128}};
  EXPECT_EQ(value_of(settings, kGlobalScaler), 128U);
  EXPECT_EQ(value_of(settings, kChopconf), 0x140100C3U);
  settings.current.range.global_scaler = 256;
  EXPECT_EQ(value_of(settings, kGlobalScaler), 0U) << "0 is 256";
}

TEST(TmcRegisters, TellTheirStatusAtThePlacesOfEachModel) {
  const Status uart = statusOf(Model::kTmc2209, 0xC0090345);
  EXPECT_TRUE(uart.temperature_warning);
  EXPECT_FALSE(uart.over_temperature);
  EXPECT_STREQ(uart.short_circuit, "coil A to ground");
  EXPECT_TRUE(uart.open_load_a);
  EXPECT_EQ(uart.at_least_celsius, 143);
  EXPECT_EQ(uart.present_scale, 9);
  EXPECT_EQ(uart.stealth_chop, true);
  EXPECT_TRUE(uart.standstill);
  const Status spi = statusOf(Model::kTmc2130, 0x961F0155);
  EXPECT_TRUE(spi.temperature_warning);
  EXPECT_TRUE(spi.over_temperature);
  EXPECT_STREQ(spi.short_circuit, "coil B to ground");
  EXPECT_EQ(spi.stall_guard, 0x155);
  EXPECT_EQ(spi.present_scale, 31);
  EXPECT_FALSE(spi.stealth_chop);
  EXPECT_STREQ(statusOf(Model::kTmc5160, 1U << 13U).short_circuit, "coil B to the supply");
  EXPECT_EQ(statusOf(Model::kTmc2130, 1U << 13U).short_circuit, nullptr);
  EXPECT_EQ(statusOf(Model::kTmc5160, 1U << 14U).stealth_chop, true);
}

TEST(TmcRegisters, DelayTheHoldCurrentByUnitsOf22Milliseconds) {
  EXPECT_EQ(powerDownOf(0.0, Model::kTmc2209), 2U);
  EXPECT_EQ(powerDownOf(0.437, Model::kTmc2209), 20U);
  for (const Model model : {Model::kTmc2209, Model::kTmc2130}) {
    EXPECT_EQ(powerDownOf(longestHoldDelay(model), model), 255U);
  }
  EXPECT_NEAR(longestHoldDelay(Model::kTmc2209), 5.571, 1e-3);
  EXPECT_NEAR(longestHoldDelay(Model::kTmc2130), 5.064, 1e-3);
}

// The TMC2130 has a faster clock, so the same speed is more of its clocks.
TEST(TmcRegisters, CompareSpeedsByTheClockOfEachModel) {
  EXPECT_EQ(thresholdOf(100.0, Model::kTmc2209), 469U);
  EXPECT_EQ(thresholdOf(100.0, Model::kTmc5160), 469U);
  EXPECT_EQ(thresholdOf(100.0, Model::kTmc2130), 516U);
  EXPECT_EQ(thresholdOf(0.0, Model::kTmc2209), 0U);
}

TEST(TmcRegisters, DetectStallsInAnyMotionAboveASpeed) {
  Settings settings;
  const auto written = [&settings](std::uint8_t number) {
    std::uint32_t value = 0;
    for (const RegisterValue& one : setUpOf(settings, 16)) {
      if (one.number == number) value = one.value;
    }
    return value;
  };
  EXPECT_EQ(written(kTcoolthrs), 0U);
  EXPECT_EQ(written(kSgthrs), 0U);
  settings.stall_threshold = 60;
  settings.stall_above = 100.0;
  EXPECT_EQ(written(kTcoolthrs), 469U);
  EXPECT_EQ(written(kSgthrs), 60U);
}

TEST(TmcRegisters, DetectStallsBySgtOnSpi) {
  EXPECT_FALSE(detectsStalls(Model::kTmc2208));
  for (const Model model : {Model::kTmc2130, Model::kTmc5160}) {
    EXPECT_TRUE(detectsStalls(model));
    EXPECT_EQ(stallThresholdsOf(model).least, -64);
    EXPECT_EQ(stallThresholdsOf(model).most, 63);
    EXPECT_EQ(loadRegisterOf(model), kDrvStatus);
    // The lowest 10 bits of DRV_STATUS.
    EXPECT_TRUE(isStall(model, 0xFFFFFC00, 63));
    EXPECT_FALSE(isStall(model, 1, 63));
    EXPECT_FALSE(isStall(model, 0x200, -64));
  }
  EXPECT_EQ(coolconfOf(0), 0U);
  EXPECT_EQ(coolconfOf(63), 0x3F0000U);
  EXPECT_EQ(coolconfOf(-1), 0x7F0000U);
  EXPECT_EQ(coolconfOf(-64), 0x400000U);
  // diag0_error, diag0_stall and diag1_stall; not en_pwm_mode.
  EXPECT_EQ(gconfForStallOnSpi(), 0x1A0U);
  EXPECT_EQ(stallThresholdsOf(Model::kTmc2209).most, 255);
  EXPECT_TRUE(isStall(Model::kTmc2209, 120, 60));
  EXPECT_FALSE(isStall(Model::kTmc2209, 122, 60));
}

}  // namespace
}  // namespace stepdriver::driver::tmc
