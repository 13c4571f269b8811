#include <gtest/gtest.h>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

using driver::DriverChip;
using driver::TranslatorState;

/// A driver that exists only in its configuration, with every pin.
ConfigValue describedAxis() {
  ConfigValue axis = linearAxis();
  put(axis, "driver", "step_dir");
  put(axis, "pins/enable", "EN");
  put(axis, "chip",
      mapOf({{"step_active", "low"},
             {"enable_active", "high"},
             {"sleep_active", "high"},
             {"reset_active", "low"},
             {"fault_active", "high"},
             {"fault_ended_by", "enable"},
             {"when_disabled", "home"},
             {"when_asleep", "held"},
             {"microstep_codes", "1 LL, 4 HL, 16 HH, 16 LH"}}));
  put(axis, "timing",
      mapOf({{"step_high_us", 1.5},
             {"step_low_us", 2.5},
             {"dir_setup_us", 3.0},
             {"dir_hold_us", 4.0},
             {"mode_setup_us", 5.0},
             {"mode_hold_us", 6.0},
             {"enable_ms", 7.0},
             {"wake_ms", 8.0},
             {"reset_low_ms", 9.0},
             {"reset_wait_ms", 10.0}}));
  return axis;
}

/// The least that a described driver needs.
ConfigValue plainDescribedAxis() {
  ConfigValue axis = linearAxis();
  put(axis, "driver", "step_dir");
  put(axis, "timing",
      mapOf({{"step_high_us", 2.0},
             {"step_low_us", 2.0},
             {"dir_setup_us", 1.0},
             {"dir_hold_us", 1.0}}));
  return axis;
}

TEST(ReadChip, TakesAWholeChipFromTheConfiguration) {
  const DriverChip chip = readX(describedAxis()).driver;
  EXPECT_EQ(chip.name, "step_dir");
  EXPECT_FALSE(chip.step_active);
  EXPECT_TRUE(chip.enable_on);
  EXPECT_EQ(chip.sleep_asleep, true);
  EXPECT_EQ(chip.reset_held, false);
  EXPECT_EQ(chip.fault_active, true);
  EXPECT_EQ(chip.fault_end, driver::FaultEnd::kEnable);
  EXPECT_EQ(chip.disabled, TranslatorState::kHome);
  EXPECT_EQ(chip.asleep, TranslatorState::kHeld);
  EXPECT_EQ(chip.mode_pins, 2);
  EXPECT_EQ(chip.microsteps, (std::vector<int>{1, 4, 16}));
  EXPECT_EQ(driver::codeOf(chip, 16), (driver::ModeCode{true, true, false})) << "its first code";
  EXPECT_EQ(driver::microstepsOf(chip, {false, true, false}), 16);
  const driver::Timing& timing = chip.timing;
  EXPECT_EQ(timing.step_high_ns, 1'500);
  EXPECT_EQ(timing.step_low_ns, 2'500);
  EXPECT_EQ(timing.dir_setup_ns, 3'000);
  EXPECT_EQ(timing.dir_hold_ns, 4'000);
  EXPECT_EQ(timing.mode_setup_ns, 5'000);
  EXPECT_EQ(timing.mode_hold_ns, 6'000);
  EXPECT_EQ(timing.enable_ns, 7'000'000);
  EXPECT_EQ(timing.wake_ns, 8'000'000);
  EXPECT_EQ(timing.reset_low_ns, 9'000'000);
  EXPECT_EQ(timing.reset_wait_ns, 10'000'000);
}

TEST(ReadChip, NeedsEveryTimeOfWhatADescribedChipHas) {
  for (const char* key :
       {"step_high_us", "step_low_us", "dir_setup_us", "dir_hold_us", "mode_setup_us",
        "mode_hold_us", "enable_ms", "wake_ms", "reset_low_ms", "reset_wait_ms"}) {
    ConfigValue axis = describedAxis();
    drop(axis, std::string("timing/") + key);
    const Lines issues = issuesOfX(axis);
    ASSERT_EQ(issues.size(), 1U) << key;
    EXPECT_EQ(issues[0].rfind(std::string("/axes/x/timing/") + key + ": is missing; it must be", 0),
              0U)
        << issues[0];
  }
  ConfigValue axis = describedAxis();
  drop(axis, "chip/enable_active");
  EXPECT_EQ(issuesOfX(axis), lineOfX("chip/enable_active", "is missing; it must be low or high"));
}

TEST(ReadChip, NeedsToKnowWhatEndsAFaultOfADescribedChip) {
  ConfigValue axis = plainDescribedAxis();
  put(axis, "chip/fault_active", "low");
  EXPECT_EQ(issuesOfX(axis), lineOfX("chip/fault_ended_by",
                                     "is missing; it must be itself, reset, enable or power"));
  for (const char* by : {"itself", "power"}) {
    put(axis, "chip/fault_ended_by", by);
    EXPECT_EQ(issuesOfX(axis), Lines{}) << by;
  }
  put(axis, "chip/fault_ended_by", "reset");
  EXPECT_EQ(issuesOfX(axis), lineOfX("chip/fault_ended_by",
                                     "is \"reset\", but the step_dir driver has no RESET pin: "
                                     "/axes/x/chip/reset_active is none"));
  put(axis, "chip/fault_ended_by", "enable");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("timing/reset_low_ms", "is missing; it must be a number from 0 to 10000"));
  put(axis, "chip/fault_active", "none");
  EXPECT_EQ(issuesOfX(axis), lineOfX("chip/fault_ended_by",
                                     "is \"enable\", but the step_dir driver has no fault output: "
                                     "/axes/x/chip/fault_active is none"));
}

TEST(ReadChip, NeedsNoTimeOfWhatADescribedChipLacks) {
  const AxisConfig config = readX(plainDescribedAxis());
  EXPECT_TRUE(config.driver.step_active);
  EXPECT_FALSE(config.driver.sleep_asleep || config.driver.reset_held);
  EXPECT_EQ(config.microsteps, 16) << "any number of microsteps is declared";
  expectIssues(plainDescribedAxis(),
               {{"microsteps", 125, ""},
                {"microsteps", 257, "is 257, but must be from 1 to 256"},
                {"pins/ms1", "A",
                 "is \"A\", but the step_dir driver has no microstep pins: its microsteps are set "
                 "by switches"},
                {"pins/sleep", "A", "is \"A\", but the step_dir driver has no SLEEP pin"},
                {"common_anode", true, ""}});
}

TEST(ReadChip, OverridesTheDataOfANamedChip) {
  ConfigValue axis = linearAxis();
  put(axis, "chip", mapOf({{"reset_active", "none"}, {"enable_active", "high"}}));
  const DriverChip chip = readX(axis).driver;
  EXPECT_EQ(chip.name, "a4988");
  EXPECT_TRUE(chip.enable_on);
  EXPECT_FALSE(chip.reset_held);
  EXPECT_EQ(chip.sleep_asleep, false) << "as in the datasheet";
  EXPECT_EQ(chip.disabled, TranslatorState::kCounts);
  EXPECT_EQ(chip.microsteps, driver::driverChip("a4988").microsteps);
}

TEST(ReadChip, RefusesContradictionsWithTheFullName) {
  expectIssues(
      describedAxis(),
      {{"chip/microstep_codes", "1 LL, 2 HL, 16 HL",
        "is \"1 LL, 2 HL, 16 HL\", but must use each code once: HL selects 2 and 16 microsteps"},
       {"chip/microstep_codes", "1 LLL, 16 HHH",
        "is \"1 LLL, 16 HHH\", but must lead from each mode to each other one, one pin at a time "
        "and over its codes only: there is no way from 1 to 16 microsteps"},
       {"chip/microstep_codes", "1 LL, 16 HHL",
        "is \"1 LL, 16 HHL\", but must have codes of the same length: LL and HHL are for different "
        "numbers of pins"},
       {"chip/step_active", "rising", "is \"rising\", but must be low or high"},
       {"chip/fault_active", true, "is true (a boolean), but must be low, high or none"},
       {"chip/when_disabled", "off", "is \"off\", but must be held, counts or home"},
       {"chip/step_activ", "low", "is not known; did you mean step_active?"},
       {"chip", "a4988", "is \"a4988\" (a string), but must be a map"}});
  for (const char* bad : {"", "1", "LL", "1 LL 2 HL", "1 LX", "0 LL", "257 LL", "1 LLLL", "x LL"}) {
    ConfigValue axis = describedAxis();
    put(axis, "chip/microstep_codes", bad);
    const Lines issues = issuesOfX(axis);
    ASSERT_EQ(issues.size(), 1U) << bad;
    EXPECT_NE(issues[0].find("but must be modes from 1 to 256 and their codes"), std::string::npos)
        << issues[0];
  }
  ConfigValue asleep = plainDescribedAxis();
  put(asleep, "chip/when_asleep", "held");
  EXPECT_EQ(issuesOfX(asleep), lineOfX("chip/when_asleep",
                                       "is \"held\", but the step_dir driver has no SLEEP pin: "
                                       "/axes/x/chip/sleep_active is none"));
}

TEST(ReadChip, RefusesAHoldThatOutlastsTheStepsOfTheTopSpeed) {
  expectIssues(linearAxis(),  // 8000 steps/s
               {{"timing/dir_hold_us", 125, ""},
                {"timing/dir_hold_us", 126,
                 "is 126, but must be at most 125: at max_speed_mm_s, which is 100.0, a step "
                 "follows every 125 us"}});
}

TEST(ReadChip, RefusesAModeThatLinesCannotSelect) {
  ConfigValue axis = linearAxis();
  put(axis, "driver", "drv8434");
  put(axis, "microsteps", 128);
  EXPECT_EQ(issuesOfX(axis), Lines{}) << "strapped";
  put(axis, "pins/m0", "A");
  put(axis, "pins/m1", "B");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("microsteps",
                    "is 128, but with the microstep pins wired it must be 1, 2, 4 or 8: lines that "
                    "are high or low select no other mode of the DRV8434"));
  put(axis, "microsteps", 8);
  put(axis, "pins/m2", "C");
  EXPECT_EQ(issuesOfX(axis), lineOfX("pins/m2",
                                     "is \"C\", but the DRV8434 has no third microstep "
                                     "pin"));
  drop(axis, "pins/m1");
  drop(axis, "pins/m2");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("pins/m1",
                    "is missing; wire both microstep pins, or none if the board is strapped to "
                    "`microsteps` (wired: m0)"));
}

TEST(ReadChip, TakesCwAndCcwInsteadOfStepAndDir) {
  ConfigValue axis = plainDescribedAxis();
  put(axis, "chip/step_inputs", "cw_ccw");
  EXPECT_EQ(issuesOfX(axis).size(), 4U) << "step and dir are there, and cw and ccw are missing";
  drop(axis, "pins/step");
  drop(axis, "pins/dir");
  put(axis, "pins/cw", "A");
  put(axis, "pins/ccw", "B");
  put(axis, "invert/ccw", true);
  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.driver.step_inputs, driver::StepInputs::kCwCcw);
  EXPECT_EQ(config.pins.step.line, "A");
  EXPECT_EQ(config.pins.dir.line, "B");
  EXPECT_FALSE(config.pins.step.inverted);
  EXPECT_TRUE(config.pins.dir.inverted);
  expectIssues(axis, {{"pins/dir", "C",
                       "is \"C\", but the step_dir driver has CW and CCW inputs: give "
                       "/axes/x/pins/ccw"},
                      {"invert/dir", true,
                       "is true, but the step_dir driver has CW and CCW inputs: to reverse the "
                       "axis, swap pins/cw and pins/ccw"},
                      {"chip/step_edges", "both",
                       "is \"both\", but each edge can be a step only on a STEP input, not on CW "
                       "and CCW"},
                      {"chip/step_inputs", "cw",
                       "is \"cw\", but must be step_dir, cw_ccw or phases; did you mean cw_ccw?"}});
  put(axis, "common_anode", true);
  EXPECT_EQ(issuesOfX(axis), lineOfX("invert/ccw", "is true, but common_anode inverts it already"));
  expectIssues(linearAxis(), {{"pins/cw", "C",
                               "is \"C\", but the A4988 has STEP and DIR inputs: give "
                               "/axes/x/pins/step"}});
}

TEST(ReadChip, AllowsAStepForEachEdgeAtTheTimesBetweenThem) {
  ConfigValue axis = plainDescribedAxis();  // 2 us high, 2 us low
  put(axis, "chip/step_edges", "both");
  EXPECT_TRUE(readX(axis).driver.both_edges);
  expectIssues(axis, {{"max_speed_mm_s", 6250, ""},
                      {"max_speed_mm_s", 6251,
                       "is 6251, but must be at most 6250: it is 500080 steps/s (at 80 steps per "
                       "mm), and the step_dir driver takes at most 500000 steps/s (2 us high, 2 us "
                       "low, each edge a step)"},
                      {"chip/step_edges", "rising", "is \"rising\", but must be one or both"}});
}

}  // namespace
}  // namespace stepdriver::config
