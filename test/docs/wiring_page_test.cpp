// Compares the tables of docs/wiring.md with the shipped configurations and the chips' data.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "page.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::docs {
namespace {

using config::ConfigValue;

/// A column of a table, by the first cell of each row, from the rows with this many cells.
std::map<std::string, std::string> column(const std::string& heading, std::size_t index,
                                          std::size_t cells) {
  std::map<std::string, std::string> column;
  for (const Cells& row : tableRows("docs/wiring.md", heading)) {
    if (row.size() == cells) column[row[0]] = row[index];
  }
  return column;
}

const ConfigValue* at(const ConfigValue* value, const std::string& path) {
  for (const std::string& key : split(path, '/')) {
    const auto* map = value != nullptr ? value->as<ConfigValue::Map>() : nullptr;
    value = map != nullptr && map->count(key) > 0 ? &map->at(key) : nullptr;
  }
  return value;
}

TEST(WiringPage, HasTheLinesOfTheShippedConfigurations) {
  const auto lines = column("A Raspberry Pi's header", 1, 6);
  int compared = 0;
  for (const char* name : {"a4988", "drv8825", "tb6600", "wheel", "rotary_axis"}) {
    const ConfigValue config =
        yaml::load(std::string(STEPDRIVER_SOURCES "/config/") + name + ".yaml");
    for (const auto& [signal, line] : lines) {
      std::vector<std::string> keys = {"pins/" + signal};
      if (signal == "endstop min") keys = {"endstops/min/pin"};
      if (signal == "endstop max") keys = {"endstops/max/pin"};
      if (const auto slash = signal.find(" / "); slash != std::string::npos) {
        keys = {"pins/" + signal.substr(0, slash), "pins/" + signal.substr(slash + 3)};
      }
      for (const std::string& key : keys) {
        const ConfigValue* pin = at(&config, "axes/x/" + key);
        if (pin == nullptr) continue;
        EXPECT_EQ(*pin->as<std::string>(), line) << name << ".yaml " << key;
        ++compared;
      }
    }
  }
  EXPECT_GE(compared, 25);
}

/// The first time in a cell [ns]; 0 if it contains none.
std::int64_t firstTime(const std::string& cell) {
  char* unit = nullptr;
  const double number = std::strtod(cell.c_str(), &unit);
  const std::string name = trimmed(unit);
  const double ns = name.rfind("ms", 0) == 0 ? 1e6 : name.rfind("us", 0) == 0 ? 1e3 : 1.0;
  return std::llround(number * ns);
}

class WiringPageOfAChip : public testing::TestWithParam<std::string> {
 protected:
  const driver::DriverChip& chip() const { return *driver::findDriverChip(GetParam()); }
  std::map<std::string, std::string> facts() const {
    const auto names = driver::driverChipNames();
    const auto found = std::find(names.begin(), names.end(), GetParam());
    return column("The chips", 1 + static_cast<std::size_t>(found - names.begin()),
                  1 + names.size());
  }
};

TEST_P(WiringPageOfAChip, HasTheTimesThatAreKept) {
  auto facts = this->facts();
  const driver::Timing& timing = chip().timing;
  EXPECT_EQ(firstTime(facts["STEP high at least"]), timing.step_high_ns);
  EXPECT_EQ(firstTime(facts["STEP low at least"]), timing.step_low_ns);
  EXPECT_EQ(firstTime(facts["DIR setup and hold"]), timing.dir_setup_ns);
  EXPECT_EQ(firstTime(facts["DIR setup and hold"]), timing.dir_hold_ns);
  EXPECT_EQ(firstTime(facts["Enable to first STEP"]), timing.enable_ns);
  if (!chip().modes.empty()) {
    EXPECT_EQ(firstTime(facts["Mode setup and hold"]), timing.mode_setup_ns);
    EXPECT_EQ(firstTime(facts["Mode setup and hold"]), timing.mode_hold_ns);
  }
  if (chip().has_sleep) {
    EXPECT_EQ(firstTime(facts["Wake-up to first STEP"]), timing.wake_ns);
  }
}

TEST_P(WiringPageOfAChip, HasTheModesAndTheirCodes) {
  auto facts = this->facts();
  std::string microsteps;
  std::string codes;
  for (const int mode : chip().microsteps) {
    microsteps += (microsteps.empty() ? "" : ", ") + std::to_string(mode);
    const auto code = driver::codeOf(chip(), mode);
    if (!code) continue;
    codes += codes.empty() ? "" : ", ";
    for (const bool level : *code) codes += level ? 'H' : 'L';
  }
  EXPECT_EQ(facts["Microsteps"], microsteps);
  std::string shown = facts["Their codes, L low and H high"];
  shown.erase(std::remove(shown.begin(), shown.end(), '*'), shown.end());
  EXPECT_EQ(shown, codes.empty() ? "switches" : codes);
}

INSTANTIATE_TEST_SUITE_P(Chips, WiringPageOfAChip, testing::ValuesIn(driver::driverChipNames()));

}  // namespace
}  // namespace stepdriver::docs
