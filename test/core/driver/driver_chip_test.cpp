#include "stepdriver_core/driver/driver_chip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

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

void expectCodes(const std::string& model, const std::map<int, std::string>& codes,
                 const std::map<std::string, int>& decoded) {
  const DriverChip& chip = driverChip(model);
  for (const int microsteps : {1, 2, 4, 8, 16, 32, 64, 128, 3, 0}) {
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
  expectCodes("a4988", {{1, "LLL"}, {2, "HLL"}, {4, "LHL"}, {8, "HHL"}, {16, "HHH"}},
              {{"LLL", 1}, {"HLL", 2}, {"LHL", 4}, {"HHL", 8}, {"HHH", 16}});
}

TEST(Chip, Drv8825DecodesAllEightCodes) {
  expectCodes("drv8825", {{1, "LLL"}, {2, "HLL"}, {4, "LHL"}, {8, "HHL"}, {16, "LLH"}, {32, "HLH"}},
              {{"LLL", 1},
               {"HLL", 2},
               {"LHL", 4},
               {"HHL", 8},
               {"LLH", 16},
               {"HLH", 32},
               {"LHH", 32},
               {"HHH", 32}});
}

TEST(Chip, Lv8729DecodesAllEightCodes) {
  expectCodes("lv8729",
              {{1, "LLL"},
               {2, "HLL"},
               {4, "LHL"},
               {8, "HHL"},
               {16, "LLH"},
               {32, "HLH"},
               {64, "LHH"},
               {128, "HHH"}},
              {{"LLL", 1},
               {"HLL", 2},
               {"LHL", 4},
               {"HHL", 8},
               {"LLH", 16},
               {"HLH", 32},
               {"LHH", 64},
               {"HHH", 128}});
}

/// A chip with two microstep pins, and the mode of LL, HL, LH and HH.
struct TwoPinCodes {
  const char* chip;
  int low_low, high_low, low_high, high_high;
};

TEST(Chip, DecodesTheFourCodesOfTwoPins) {
  for (const TwoPinCodes& sheet :
       {TwoPinCodes{"tmc2208", 8, 2, 4, 16}, TwoPinCodes{"tmc2209", 8, 32, 64, 16},
        TwoPinCodes{"tmc2130", 1, 2, 4, 16}, TwoPinCodes{"drv8434", 1, 2, 4, 8}}) {
    const DriverChip& chip = driverChip(sheet.chip);
    EXPECT_EQ(chip.mode_pins, 2) << sheet.chip;
    EXPECT_EQ(microstepsOf(chip, codeFrom("LLL")), sheet.low_low) << sheet.chip;
    EXPECT_EQ(microstepsOf(chip, codeFrom("HLL")), sheet.high_low) << sheet.chip;
    EXPECT_EQ(microstepsOf(chip, codeFrom("LHL")), sheet.low_high) << sheet.chip;
    EXPECT_EQ(microstepsOf(chip, codeFrom("HHL")), sheet.high_high) << sheet.chip;
    EXPECT_EQ(microstepsOf(chip, codeFrom("LLH")), std::nullopt) << sheet.chip;
  }
}

TEST(Chip, HasTheModesOfItsSwitches) {
  const std::vector<int> of_dm{2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128};
  const std::map<std::string, std::vector<int>> switches{{"tb6600", {1, 2, 4, 8, 16, 32}},
                                                         {"tb6560", {1, 2, 8, 16}},
                                                         {"dm542", of_dm},
                                                         {"dm556", of_dm},
                                                         {"cl57t", {}}};
  for (const auto& [name, microsteps] : switches) {
    expectCodes(name, {}, {});
    EXPECT_EQ(driverChip(name).microsteps, microsteps) << name;
    EXPECT_TRUE(driverChip(name).opto_inputs) << name;
  }
}

TEST(Chip, ListsTheMicrostepsThatItsPinsSelect) {
  for (const std::string& name : driverChipNames()) {
    const DriverChip& chip = driverChip(name);
    std::vector<int> selectable = selectableMicrosteps(chip);
    std::sort(selectable.begin(), selectable.end());
    if (chip.modes.empty() || name == "drv8434") continue;  // it has more with an open pin
    EXPECT_EQ(chip.microsteps, selectable) << chip.title;
    EXPECT_FALSE(chip.opto_inputs) << chip.title;
  }
  EXPECT_EQ(driverChip("drv8434").microsteps, (std::vector<int>{1, 2, 4, 8, 16, 32, 64, 128, 256}));
}

TEST(Chip, IsFoundByTheNameInConfigurations) {
  EXPECT_EQ(driverChipNames(),
            (std::vector<std::string>{"a4988", "drv8825", "tb6600", "tmc2208", "tmc2209", "tmc2226",
                                      "tmc2130", "tmc5160", "drv8434", "lv8729", "tb6560", "dm542",
                                      "dm556", "cl57t", "uln2003"}));
  for (const std::string& name : driverChipNames()) {
    ASSERT_NE(findDriverChip(name), nullptr) << name;
    EXPECT_EQ(findDriverChip(name), &driverChip(name)) << name;
  }
  EXPECT_EQ(findDriverChip("A4988"), findDriverChip("a4988"));
  EXPECT_EQ(findDriverChip("Drv8825"), findDriverChip("drv8825"));
  EXPECT_EQ(findDriverChip("a498"), nullptr);
  EXPECT_EQ(findDriverChip("a49888"), nullptr);
  EXPECT_EQ(findDriverChip(""), nullptr);
  EXPECT_THROW(driverChip("a498"), Error);
}

/// [ns] The DRV8825's gap is the part of the 4 us between two steps that remains after the pulse.
struct TimingFigures {
  const char* chip;
  std::int64_t high, low, dir, mode, enable, wake;
};

TEST(Chip, KeepsTheTimingOfItsDatasheet) {
  const std::vector<TimingFigures> datasheets{
      {"a4988", 1'000, 1'000, 200, 200, 0, 1'000'000},
      {"drv8825", 1'900, 2'100, 650, 650, 650, 1'700'000},
      {"tb6600", 5'000, 5'000, 5'000, 0, 200'000'000, 0},
      {"tmc2208", 200, 200, 20, 1'000, 1'000'000, 0},
      {"tmc2209", 200, 200, 20, 1'000, 1'000'000, 0},
      {"tmc2226", 200, 200, 20, 1'000, 1'000'000, 0},
      {"tmc2130", 200, 200, 20, 1'000, 1'000'000, 0},
      {"tmc5160", 200, 200, 20, 1'000, 1'000'000, 0},
      {"drv8434", 1'000, 1'000, 200, 200, 5'000, 2'000'000},
      {"lv8729", 1'000, 1'000, 500, 500, 1'000'000, 2'000'000},
      {"tb6560", 30'000, 37'000, 15'000, 0, 200'000'000, 0},
      {"dm542", 2'500, 2'500, 5'000, 0, 200'000'000, 0},
      {"dm556", 2'500, 2'500, 5'000, 0, 200'000'000, 0},
      {"cl57t", 2'500, 2'500, 5'000, 0, 500'000'000, 0},
      {"uln2003", 1'000, 1'000, 0, 0, 10'000'000, 0}};
  EXPECT_EQ(datasheets.size(), driverChipNames().size());
  for (const TimingFigures& sheet : datasheets) {
    const DriverChip& chip = driverChip(sheet.chip);
    EXPECT_EQ(chip.timing.step_high_ns, sheet.high) << chip.title;
    EXPECT_EQ(chip.timing.step_low_ns, sheet.low) << chip.title;
    EXPECT_EQ(chip.timing.dir_setup_ns, sheet.dir) << chip.title;
    EXPECT_EQ(chip.timing.dir_hold_ns, sheet.dir) << chip.title;
    EXPECT_EQ(chip.timing.mode_setup_ns, sheet.mode) << chip.title;
    EXPECT_EQ(chip.timing.mode_hold_ns, sheet.mode) << chip.title;
    EXPECT_EQ(chip.timing.enable_ns, sheet.enable) << chip.title;
    EXPECT_EQ(chip.timing.wake_ns, sheet.wake) << chip.title;
    const bool resets = chip.reset_held || chip.fault_end == FaultEnd::kEnable;
    EXPECT_EQ(chip.timing.reset_low_ns, resets ? 1'000'000 : 0) << chip.title;
    EXPECT_EQ(chip.timing.reset_wait_ns, chip.reset_held ? sheet.wake : 0) << chip.title;
  }
}

/// Levels: of ENABLE that energizes, of SLEEP that puts to sleep, of RESET that holds, and of the
/// fault output at a fault; L, H, or - if there is no such pin.
struct LevelFigures {
  const char* chip;
  char enable, sleep, reset, fault;
  TranslatorState disabled;
};

char letterOf(std::optional<bool> level) { return !level ? '-' : *level ? 'H' : 'L'; }

TEST(Chip, KnowsItsPinsAndTheirLevels) {
  const TranslatorState held = TranslatorState::kHeld;
  const TranslatorState counts = TranslatorState::kCounts;
  const std::vector<LevelFigures> datasheets{
      {"a4988", 'L', 'L', 'L', '-', counts},   {"drv8825", 'L', 'L', 'L', 'L', held},
      {"tb6600", 'L', '-', '-', '-', held},    {"tmc2208", 'L', '-', '-', 'H', counts},
      {"tmc2209", 'L', '-', '-', 'H', counts}, {"tmc2130", 'L', '-', '-', '-', counts},
      {"drv8434", 'H', 'L', '-', 'L', held},   {"lv8729", 'L', 'L', '-', '-', held},
      {"tb6560", 'L', '-', '-', '-', held},    {"dm542", 'L', '-', '-', '-', held},
      {"dm556", 'L', '-', '-', '-', held},     {"cl57t", 'L', '-', '-', 'H', held},
      {"tmc2226", 'L', '-', '-', 'H', counts}, {"tmc5160", 'L', '-', '-', '-', counts},
      {"uln2003", 'L', '-', '-', '-', held}};
  EXPECT_EQ(datasheets.size(), driverChipNames().size());
  for (const LevelFigures& sheet : datasheets) {
    const DriverChip& chip = driverChip(sheet.chip);
    EXPECT_TRUE(chip.step_active) << chip.title;
    EXPECT_EQ(letterOf(chip.enable_on), sheet.enable) << chip.title;
    EXPECT_EQ(letterOf(chip.sleep_asleep), sheet.sleep) << chip.title;
    EXPECT_EQ(letterOf(chip.reset_held), sheet.reset) << chip.title;
    EXPECT_EQ(letterOf(chip.fault_active), sheet.fault) << chip.title;
    EXPECT_EQ(chip.disabled, sheet.disabled) << chip.title;
    EXPECT_EQ(chip.asleep, TranslatorState::kHome) << chip.title;
  }
}

TEST(Chip, HasPatternsOfCoilsInWhichOneChangesAtEachHalfStep) {
  const DriverChip& chip = driverChip("uln2003");
  EXPECT_EQ(chip.step_inputs, StepInputs::kPhases);
  EXPECT_TRUE(chip.both_edges);
  EXPECT_EQ(chip.microsteps, (std::vector<int>{1, 2}));
  for (std::size_t i = 0; i < kHalfSteps.size(); ++i) {
    const unsigned changes = kHalfSteps.at(i) ^ kHalfSteps.at((i + 1) % kHalfSteps.size());
    EXPECT_EQ(changes & (changes - 1), 0U) << i;
    EXPECT_NE(changes, 0U) << i;
    const unsigned coils = kHalfSteps.at(i);
    EXPECT_EQ((coils & (coils - 1)) != 0, i % 2 == 0) << "full steps have two coils: " << i;
  }
}

TEST(Chip, KnowsWhatEndsAFaultAndWhetherItSaysThatItIsInPosition) {
  const std::map<std::string, FaultEnd> ends{{"drv8825", FaultEnd::kReset},
                                             {"tmc2208", FaultEnd::kEnable},
                                             {"tmc2209", FaultEnd::kEnable},
                                             {"tmc2226", FaultEnd::kEnable}};
  for (const std::string& name : driverChipNames()) {
    const DriverChip& chip = driverChip(name);
    EXPECT_EQ(chip.fault_end, ends.count(name) > 0 ? ends.at(name) : FaultEnd::kPower) << name;
    EXPECT_EQ(letterOf(chip.in_position_active), name == "cl57t" ? 'L' : '-') << name;
  }
}

int differences(const ModeCode& a, const ModeCode& b) {
  int count = 0;
  for (std::size_t pin = 0; pin < a.size(); ++pin) count += a[pin] != b[pin] ? 1 : 0;
  return count;
}

TEST(ModePath, ChangesOnePinAtATimeOverDefinedCodesOnly) {
  for (const std::string& name_of_chip : driverChipNames()) {
    const DriverChip& chip = driverChip(name_of_chip);
    for (const int from : selectableMicrosteps(chip)) {
      for (const int to : selectableMicrosteps(chip)) {
        const std::string name =
            chip.title + " from " + std::to_string(from) + " to " + std::to_string(to);
        const std::vector<ModeCode> path = modePath(chip, from, to);
        ModeCode at = *codeOf(chip, from);
        for (const ModeCode& next : path) {
          EXPECT_EQ(differences(at, next), 1)
              << name << ": " << levelsOf(at) << " to " << levelsOf(next);
          EXPECT_TRUE(microstepsOf(chip, next)) << name << ": over " << levelsOf(next);
          at = next;
        }
        EXPECT_EQ(levelsOf(at), levelsOf(*codeOf(chip, to))) << name;
      }
    }
  }
}

TEST(ModePath, IsAsShortAsTheDefinedCodesAllow) {
  const DriverChip& a4988 = driverChip("a4988");
  EXPECT_EQ(modePath(a4988, 1, 1).size(), 0U);
  EXPECT_EQ(modePath(a4988, 1, 2).size(), 1U);
  EXPECT_EQ(modePath(a4988, 1, 16).size(), 3U);
  EXPECT_EQ(modePath(a4988, 16, 8).size(), 1U);
  const DriverChip& drv8825 = driverChip("drv8825");
  for (const int from : drv8825.microsteps) {
    for (const int to : drv8825.microsteps) {
      EXPECT_EQ(modePath(drv8825, from, to).size(),
                static_cast<std::size_t>(differences(*codeOf(drv8825, from), *codeOf(drv8825, to))))
          << from << " to " << to;
    }
  }
}

TEST(ModePath, RefusesModesWithoutACode) {
  EXPECT_THROW(modePath(driverChip("a4988"), 1, 32), Error);
  EXPECT_THROW(modePath(driverChip("a4988"), 32, 1), Error);
  EXPECT_THROW(modePath(driverChip("drv8825"), 3, 3), Error);
  EXPECT_THROW(modePath(driverChip("tb6600"), 1, 2), Error);
}

TEST(KeepsPosition, WhereBothModesHaveAPlace) {
  for (std::int64_t index = -64; index <= 64; ++index) {
    EXPECT_EQ(keepsPosition(index, 16, 4), index % 4 == 0) << index;
    EXPECT_EQ(keepsPosition(index, 16, 1), index % 16 == 0) << index;
    EXPECT_TRUE(keepsPosition(index, 16, 16)) << index;
    EXPECT_TRUE(keepsPosition(index, 4, 32)) << index;
    EXPECT_EQ(keepsPosition(index, 16, 5), index % 16 == 0) << index;
    EXPECT_EQ(keepsPosition(index, 10, 25), index % 2 == 0) << index;
  }
}

}  // namespace
}  // namespace stepdriver::driver
