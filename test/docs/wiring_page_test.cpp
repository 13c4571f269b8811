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

/// The columns of the table with a row for each driver.
enum Figure : std::size_t {
  kName,
  kTitle,
  kMicrosteps,
  kCodes,
  kStepHigh,
  kStepLow,
  kDir,
  kMode,
  kEnable,
  kWake,
  kEnableLevel,
  kFault,
  kFigures
};

class WiringPageOfAChip : public testing::TestWithParam<std::string> {
 protected:
  const driver::DriverChip& chip() const { return driver::driverChip(GetParam()); }
  bool hasPhases() const { return chip().step_inputs == driver::StepInputs::kPhases; }
  Cells figures() const {
    for (const Cells& row : tableRows("docs/wiring.md", "The figures of every driver")) {
      if (row.size() == kFigures && row[kName] == GetParam()) return row;
    }
    ADD_FAILURE() << "docs/wiring.md has no row for " << GetParam();
    return Cells(kFigures);
  }
};

TEST_P(WiringPageOfAChip, HasTheTimesThatAreKept) {
  const Cells figures = this->figures();
  const driver::Timing& timing = chip().timing;
  EXPECT_EQ(firstTime(figures[kStepHigh]), timing.step_high_ns);
  EXPECT_EQ(firstTime(figures[kStepLow]), timing.step_low_ns);
  EXPECT_EQ(firstTime(figures[kDir]), timing.dir_setup_ns);
  EXPECT_EQ(firstTime(figures[kDir]), timing.dir_hold_ns);
  EXPECT_EQ(firstTime(figures[kEnable]), timing.enable_ns);
  EXPECT_EQ(firstTime(figures[kMode]), timing.mode_setup_ns);
  EXPECT_EQ(firstTime(figures[kMode]), timing.mode_hold_ns);
  EXPECT_EQ(firstTime(figures[kWake]), timing.wake_ns);
}

TEST_P(WiringPageOfAChip, HasTheModesAndTheirCodes) {
  const Cells figures = this->figures();
  std::string microsteps;
  for (const int mode : chip().microsteps) {
    microsteps += (microsteps.empty() ? "" : ", ") + std::to_string(mode);
  }
  EXPECT_EQ(figures[kMicrosteps], microsteps.empty() ? "1 to 256" : microsteps);
  std::string codes;
  for (const driver::Mode& mode : chip().modes) {
    codes += (codes.empty() ? "" : ", ") + std::to_string(mode.microsteps) + " ";
    for (int pin = 0; pin < chip().mode_pins; ++pin) {
      codes += mode.code[static_cast<std::size_t>(pin)] ? 'H' : 'L';
    }
  }
  const std::string none = hasPhases() ? "patterns of IN1 to IN4" : "switches";
  EXPECT_EQ(figures[kCodes], codes.empty() ? none : codes);
}

TEST_P(WiringPageOfAChip, HasTheLevelsOfEnableAndFault) {
  const Cells figures = this->figures();
  EXPECT_EQ(figures[kEnableLevel], hasPhases() ? "-" : chip().enable_on ? "high" : "low");
  const auto fault = chip().fault_active;
  EXPECT_EQ(split(figures[kFault], ':').at(0), !fault ? "-" : *fault ? "high" : "low");
  if (!fault) return;
  const std::map<driver::FaultEnd, std::string> ends = {
      {driver::FaultEnd::kItself, "by itself"},
      {driver::FaultEnd::kReset, "RESET"},
      {driver::FaultEnd::kEnable, "ENABLE is off"},
      {driver::FaultEnd::kPower, "power off"}};
  EXPECT_NE(figures[kFault].find(": " + chip().fault_name + ", until " + ends.at(chip().fault_end)),
            std::string::npos)
      << figures[kFault];
}

TEST_P(WiringPageOfAChip, HasTheInPositionOutput) {
  const auto level = chip().in_position_active;
  const std::string wanted = std::string(". In position ") +
                             (level.value_or(false) ? "high" : "low") + ": " +
                             chip().in_position_name;
  EXPECT_EQ(figures()[kFault].find(wanted) != std::string::npos, level.has_value());
}

INSTANTIATE_TEST_SUITE_P(Chips, WiringPageOfAChip, testing::ValuesIn(driver::driverChipNames()));

}  // namespace
}  // namespace stepdriver::docs
