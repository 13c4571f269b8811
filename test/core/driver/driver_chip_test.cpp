#include "stepdriver_core/driver/driver_chip.h"

#include <gtest/gtest.h>

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace stepdriver::driver {
namespace {

ModeCode codeFrom(const std::string& levels) {
  return {levels[0] == 'H', levels[1] == 'H', levels[2] == 'H'};
}

std::string levelsOf(const ModeCode& code) {
  std::string levels;
  for (const bool level : code) levels += level ? 'H' : 'L';
  return levels;
}

const std::vector<std::string>& allLevels() {
  static const std::vector<std::string> all{"LLL", "HLL", "LHL", "HHL", "LLH", "HLH", "LHH", "HHH"};
  return all;
}

void expectCodes(Model model, const std::map<int, std::string>& codes,
                 const std::map<std::string, int>& decoded) {
  const DriverChip& chip = driverChipOf(model);
  for (const int microsteps : {1, 2, 4, 8, 16, 32, 64, 3, 0}) {
    const auto code = codeOf(chip, microsteps);
    const auto expected = codes.find(microsteps);
    EXPECT_EQ(code ? levelsOf(*code) : "none", expected != codes.end() ? expected->second : "none")
        << chip.title << " at " << microsteps << " microsteps";
  }
  for (const std::string& levels : allLevels()) {
    const auto expected = decoded.find(levels);
    EXPECT_EQ(microstepsOf(chip, codeFrom(levels)).value_or(0),
              expected != decoded.end() ? expected->second : 0)
        << chip.title << " with " << levels;
  }
}

TEST(Chip, A4988DecodesFiveCodesAndLeavesThreeUndefined) {
  expectCodes(Model::kA4988, {{1, "LLL"}, {2, "HLL"}, {4, "LHL"}, {8, "HHL"}, {16, "HHH"}},
              {{"LLL", 1}, {"HLL", 2}, {"LHL", 4}, {"HHL", 8}, {"HHH", 16}});
}

TEST(Chip, Drv8825DecodesAllEightCodes) {
  expectCodes(Model::kDrv8825,
              {{1, "LLL"}, {2, "HLL"}, {4, "LHL"}, {8, "HHL"}, {16, "LLH"}, {32, "HLH"}},
              {{"LLL", 1},
               {"HLL", 2},
               {"LHL", 4},
               {"HHL", 8},
               {"LLH", 16},
               {"HLH", 32},
               {"LHH", 32},
               {"HHH", 32}});
}

TEST(Chip, Tb6600HasNoCodesForItsSwitchesAreSetByHand) {
  expectCodes(Model::kTb6600, {}, {});
  EXPECT_EQ(driverChipOf(Model::kTb6600).microsteps, (std::vector<int>{1, 2, 4, 8, 16, 32}));
}

TEST(Chip, ListsTheMicrostepsThatItsPinsSelect) {
  for (const Model model : {Model::kA4988, Model::kDrv8825}) {
    const DriverChip& chip = driverChipOf(model);
    std::vector<int> selected;
    for (const Mode& mode : chip.modes) selected.push_back(mode.microsteps);
    EXPECT_EQ(chip.microsteps, selected) << chip.title;
  }
}

TEST(Chip, IsFoundByTheNameInConfigurations) {
  EXPECT_EQ(driverChipNames(), (std::vector<std::string>{"a4988", "drv8825", "tb6600"}));
  for (const std::string& name : driverChipNames()) {
    ASSERT_NE(findDriverChip(name), nullptr) << name;
    EXPECT_EQ(findDriverChip(name), &driverChipOf(findDriverChip(name)->model)) << name;
  }
  EXPECT_EQ(findDriverChip("A4988"), findDriverChip("a4988"));
  EXPECT_EQ(findDriverChip("Drv8825"), findDriverChip("drv8825"));
  EXPECT_EQ(findDriverChip("a498"), nullptr);
  EXPECT_EQ(findDriverChip("a49888"), nullptr);
  EXPECT_EQ(findDriverChip(""), nullptr);
}

/// The DRV8825's gap is the part of the 4 us between two steps that remains after the pulse.
struct TimingFigures {
  Model model;
  std::int64_t high, low, dir, mode, enable, wake;
};

TEST(Chip, KeepsTheTimingOfItsDatasheet) {
  const std::vector<TimingFigures> datasheets{
      {Model::kA4988, 1'000, 1'000, 200, 200, 0, 1'000'000},
      {Model::kDrv8825, 1'900, 2'100, 650, 650, 650, 1'700'000},
      {Model::kTb6600, 5'000, 5'000, 5'000, 0, 200'000'000, 0}};
  for (const TimingFigures& sheet : datasheets) {
    const DriverChip& chip = driverChipOf(sheet.model);
    EXPECT_EQ(chip.timing.step_high_ns, sheet.high) << chip.title;
    EXPECT_EQ(chip.timing.step_low_ns, sheet.low) << chip.title;
    EXPECT_EQ(chip.timing.dir_setup_ns, sheet.dir) << chip.title;
    EXPECT_EQ(chip.timing.dir_hold_ns, sheet.dir) << chip.title;
    EXPECT_EQ(chip.timing.mode_setup_ns, sheet.mode) << chip.title;
    EXPECT_EQ(chip.timing.mode_hold_ns, sheet.mode) << chip.title;
    EXPECT_EQ(chip.timing.enable_ns, sheet.enable) << chip.title;
    EXPECT_EQ(chip.timing.wake_ns, sheet.wake) << chip.title;
    EXPECT_EQ(chip.timing.reset_low_ns, chip.has_reset ? 1'000'000 : 0) << chip.title;
    EXPECT_EQ(chip.timing.reset_wait_ns, chip.has_reset ? sheet.wake : 0) << chip.title;
  }
}

TEST(Chip, KnowsItsPinsAndTheirLevels) {
  for (const Model model : {Model::kA4988, Model::kDrv8825, Model::kTb6600}) {
    const DriverChip& chip = driverChipOf(model);
    const bool module = model == Model::kTb6600;
    EXPECT_EQ(chip.model, model);
    EXPECT_EQ(chip.has_sleep, !module) << chip.title;
    EXPECT_EQ(chip.has_reset, !module) << chip.title;
    EXPECT_TRUE(chip.step_active) << chip.title;
    EXPECT_FALSE(chip.enable_on) << chip.title;
    EXPECT_FALSE(chip.sleep_asleep) << chip.title;
    EXPECT_FALSE(chip.reset_held) << chip.title;
    EXPECT_EQ(chip.counts_while_disabled, model == Model::kA4988) << chip.title;
  }
}

int differences(const ModeCode& a, const ModeCode& b) {
  int count = 0;
  for (std::size_t pin = 0; pin < a.size(); ++pin) count += a[pin] != b[pin] ? 1 : 0;
  return count;
}

TEST(ModePath, ChangesOnePinAtATimeOverDefinedCodesOnly) {
  for (const Model model : {Model::kA4988, Model::kDrv8825}) {
    const DriverChip& chip = driverChipOf(model);
    for (const Mode& from : chip.modes) {
      for (const Mode& to : chip.modes) {
        const std::string name = chip.title + " from " + std::to_string(from.microsteps) + " to " +
                                 std::to_string(to.microsteps);
        const std::vector<ModeCode> path = modePath(chip, from.microsteps, to.microsteps);
        ModeCode at = from.code;
        for (const ModeCode& next : path) {
          EXPECT_EQ(differences(at, next), 1)
              << name << ": " << levelsOf(at) << " to " << levelsOf(next);
          EXPECT_TRUE(microstepsOf(chip, next)) << name << ": over " << levelsOf(next);
          at = next;
        }
        EXPECT_EQ(levelsOf(at), levelsOf(to.code)) << name;
      }
    }
  }
}

TEST(ModePath, IsAsShortAsTheDefinedCodesAllow) {
  const DriverChip& a4988 = driverChipOf(Model::kA4988);
  EXPECT_EQ(modePath(a4988, 1, 1).size(), 0U);
  EXPECT_EQ(modePath(a4988, 1, 2).size(), 1U);
  EXPECT_EQ(modePath(a4988, 1, 16).size(), 3U);
  EXPECT_EQ(modePath(a4988, 16, 8).size(), 1U);
  const DriverChip& drv8825 = driverChipOf(Model::kDrv8825);
  for (const Mode& from : drv8825.modes) {
    for (const Mode& to : drv8825.modes) {
      EXPECT_EQ(modePath(drv8825, from.microsteps, to.microsteps).size(),
                static_cast<std::size_t>(differences(from.code, to.code)))
          << from.microsteps << " to " << to.microsteps;
    }
  }
}

TEST(ModePath, RefusesModesWithoutACode) {
  EXPECT_THROW(modePath(driverChipOf(Model::kA4988), 1, 32), std::invalid_argument);
  EXPECT_THROW(modePath(driverChipOf(Model::kA4988), 32, 1), std::invalid_argument);
  EXPECT_THROW(modePath(driverChipOf(Model::kDrv8825), 3, 3), std::invalid_argument);
  EXPECT_THROW(modePath(driverChipOf(Model::kTb6600), 1, 2), std::invalid_argument);
}

TEST(KeepsPosition, WhereBothModesHaveAPlace) {
  for (std::int64_t index = -64; index <= 64; ++index) {
    EXPECT_EQ(keepsPosition(index, 16, 4), index % 4 == 0) << index;
    EXPECT_EQ(keepsPosition(index, 16, 1), index % 16 == 0) << index;
    EXPECT_TRUE(keepsPosition(index, 16, 16)) << index;
    EXPECT_TRUE(keepsPosition(index, 4, 32)) << index;
  }
}

}  // namespace
}  // namespace stepdriver::driver
