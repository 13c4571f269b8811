#include <gtest/gtest.h>

#include "support/axis_config.h"
#include "support/constants.h"

namespace stepdriver::config {
namespace {

using test::kPi;

const std::string kDrivers =
    "a4988, drv8825, tb6600, tmc2208, tmc2209, tmc2226, tmc2130, tmc5160, drv8434, lv8729, tb6560, "
    "dm542, dm556, cl57t, uln2003 or step_dir";

TEST(ReadAxes, ReadsAWholeLinearA4988) {
  ConfigValue axis = linearAxis();
  put(axis, "joint", "x_joint");
  put(axis, "pins",
      mapOf({{"step", "gpiochip0:17"},
             {"dir", "STEP-DIR"},
             {"enable", "pinctrl-bcm2835:22"},
             {"ms1", "gpiochip0:5"},
             {"ms2", "gpiochip0:6"},
             {"ms3", "gpiochip0:13"},
             {"sleep", "gpiochip0:19"},
             {"reset", "gpiochip0:26"}}));
  put(axis, "invert", mapOf({{"dir", true}, {"enable", true}, {"ms2", true}, {"step", false}}));
  put(axis, "steps_per_round", 3200);
  put(axis, "start_speed_mm_s", 5);
  put(axis, "deceleration_mm_s2", 250.0);
  put(axis, "min_position_mm", -10.0);
  put(axis, "max_position_mm", 200.0);
  put(axis, "endstops/min", mapOf({{"pin", "gpiochip0:20"}, {"active_level", "low"}}));
  put(axis, "endstops/max", mapOf({{"pin", "gpiochip0:21"}, {"active_level", "high"}}));
  put(axis, "enable_on_start", true);
  put(axis, "disable_on_shutdown", false);
  put(axis, "align_on_microstep_change", true);

  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.name, "x");
  EXPECT_EQ(config.joint, "x_joint");
  EXPECT_EQ(config.kind, Kind::kLinear);
  EXPECT_EQ(config.driver.name, "a4988");
  EXPECT_EQ(config.pins.step.line, "gpiochip0:17");
  EXPECT_EQ(config.pins.dir.line, "STEP-DIR");
  EXPECT_EQ(config.pins.enable.line, "pinctrl-bcm2835:22");
  EXPECT_EQ(config.pins.ms1.line, "gpiochip0:5");
  EXPECT_EQ(config.pins.ms2.line, "gpiochip0:6");
  EXPECT_EQ(config.pins.ms3.line, "gpiochip0:13");
  EXPECT_EQ(config.pins.sleep.line, "gpiochip0:19");
  EXPECT_EQ(config.pins.reset.line, "gpiochip0:26");
  EXPECT_FALSE(config.pins.step.inverted);
  EXPECT_TRUE(config.pins.dir.inverted);
  EXPECT_TRUE(config.pins.enable.inverted);
  EXPECT_FALSE(config.pins.ms1.inverted);
  EXPECT_TRUE(config.pins.ms2.inverted);
  EXPECT_EQ(config.microsteps, 16);
  EXPECT_EQ(config.steps_per_unit, 80000.0);
  EXPECT_EQ(config.steps_per_round, 3200.0);
  EXPECT_EQ(config.max_speed, 0.1);
  EXPECT_EQ(config.start_speed, 0.005);
  EXPECT_EQ(config.acceleration, 0.5);
  EXPECT_EQ(config.deceleration, 0.25);
  EXPECT_EQ(config.min_position, -0.01);
  EXPECT_EQ(config.max_position, 0.2);
  ASSERT_TRUE(config.endstop_min && config.endstop_max);
  EXPECT_EQ(config.endstop_min->line, "gpiochip0:20");
  EXPECT_FALSE(config.endstop_min->active_level);
  EXPECT_EQ(config.endstop_max->line, "gpiochip0:21");
  EXPECT_TRUE(config.endstop_max->active_level);
  EXPECT_TRUE(config.enable_on_start);
  EXPECT_FALSE(config.disable_on_shutdown);
  EXPECT_TRUE(config.align_on_microstep_change);
}

TEST(ReadAxes, ReadsAWholeRotaryDrv8825) {
  ConfigValue axis = rotaryAxis();
  put(axis, "pins/m0", "M0");
  put(axis, "pins/m1", "M1");
  put(axis, "pins/m2", "M2");
  put(axis, "invert/m2", true);
  put(axis, "start_speed_deg_s", 18.0);
  put(axis, "deceleration_deg_s2", 90.0);
  put(axis, "min_position_deg", -180.0);
  put(axis, "max_position_deg", 360);

  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.kind, Kind::kRotary);
  EXPECT_EQ(config.driver.name, "drv8825");
  EXPECT_EQ(config.pins.ms1.line, "M0");
  EXPECT_EQ(config.pins.ms2.line, "M1");
  EXPECT_EQ(config.pins.ms3.line, "M2");
  EXPECT_TRUE(config.pins.ms3.inverted);
  EXPECT_DOUBLE_EQ(config.steps_per_unit, 1800.0 / kPi);
  EXPECT_EQ(config.max_speed, kPi);
  EXPECT_DOUBLE_EQ(config.start_speed, kPi / 10.0);
  EXPECT_EQ(config.acceleration, 2.0 * kPi);
  EXPECT_EQ(config.deceleration, kPi / 2.0);
  EXPECT_EQ(config.min_position, -kPi);
  EXPECT_EQ(config.max_position, 2.0 * kPi);
}

TEST(ReadAxes, ReadsAWholeCommonAnodeTb6600) {
  ConfigValue axis = tb6600Axis();
  put(axis, "pins/enable", "gpiochip0:22");
  put(axis, "common_anode", true);
  drop(axis, "steps_per_mm");
  put(axis, "full_steps_per_round", 200);
  put(axis, "mm_per_round", 8.0);

  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.driver.name, "tb6600");
  EXPECT_TRUE(config.pins.step.inverted);
  EXPECT_TRUE(config.pins.dir.inverted);
  EXPECT_TRUE(config.pins.enable.inverted);
  EXPECT_EQ(config.steps_per_unit, 400000.0);
  EXPECT_EQ(config.steps_per_round, 3200.0);
}

TEST(ReadAxes, FillsInTheDefaults) {
  const AxisConfig config = readX(linearAxis());
  EXPECT_EQ(config.joint, "x");
  EXPECT_FALSE(config.pins.enable.wired());
  EXPECT_FALSE(config.pins.ms1.wired());
  EXPECT_FALSE(config.pins.step.inverted);
  EXPECT_EQ(config.steps_per_round, 0.0);
  EXPECT_EQ(config.start_speed, 0.0);
  EXPECT_EQ(config.deceleration, config.acceleration);
  EXPECT_FALSE(config.min_position || config.max_position);
  EXPECT_FALSE(config.endstop_min || config.endstop_max);
  EXPECT_FALSE(config.enable_on_start);
  EXPECT_TRUE(config.disable_on_shutdown);
  EXPECT_FALSE(config.align_on_microstep_change);
  EXPECT_EQ(config.driver.timing.step_high_ns, driver::driverChip("a4988").timing.step_high_ns);
}

TEST(ReadAxes, GivesTheAxesInTheOrderOfTheirNames) {
  std::vector<ConfigIssue> issues;
  const auto configs =
      readAxes(mapOf({{"y", rotaryAxis("b")}, {"X_2", linearAxis("a")}, {"a", linearAxis("c")}}),
               "/axes", issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  ASSERT_EQ(configs.size(), 3U);
  EXPECT_EQ(configs[0].name, "X_2");
  EXPECT_EQ(configs[1].name, "a");
  EXPECT_EQ(configs[2].name, "y");
}

TEST(ReadAxes, GivesTheAxesInTheOrderOfTheFileIfItIsKnown) {
  std::vector<ConfigIssue> issues;
  ConfigValue axes =
      mapOf({{"y", rotaryAxis("b")}, {"b", linearAxis("a")}, {"a", linearAxis("c")}});
  axes.setKeyOrder({"y", "gone", "a", "y"});
  const auto configs = readAxes(axes, "/axes", issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  ASSERT_EQ(configs.size(), 3U);
  EXPECT_EQ(configs[0].name, "y");
  EXPECT_EQ(configs[1].name, "a");
  EXPECT_EQ(configs[2].name, "b") << "not in the order that is known";
}

TEST(ReadAxes, NeedsAMapOfAtLeastOneAxis) {
  EXPECT_EQ(issuesOf({}), Lines{"/axes: is missing; it must be a map of at least one axis"});
  EXPECT_EQ(issuesOf(ConfigValue::Map{}),
            Lines{"/axes: is empty, but must be a map of at least one axis"});
  EXPECT_EQ(issuesOf("x"), Lines{"/axes: is \"x\" (a string), but must be a map"});
  EXPECT_EQ(issuesOf(mapOf({{"x", 3}})), Lines{"/axes/x: is 3 (an integer), but must be a map"});
}

TEST(ReadAxes, ChecksTheNamesOfAxes) {
  EXPECT_EQ(issuesOf(mapOf({{"2x", linearAxis()}})),
            Lines{"/axes/2x: has the name \"2x\", but an axis's name must begin with a letter and "
                  "continue with letters, digits and _ only"});
  for (const std::string good : {"x", "X", "axis_2", "a__"}) {
    EXPECT_EQ(issuesOf(mapOf({{good, linearAxis()}})), Lines{}) << good;
  }
  for (const std::string bad : {"", "2x", "_x", "x-y", "x y", "x/y", "\xc3\xa4"}) {
    const Lines lines = issuesOf(mapOf({{bad, linearAxis()}}));
    ASSERT_EQ(lines.size(), 1U) << bad;
    EXPECT_NE(lines[0].find(": has the name " + ConfigValue(bad).shown()), std::string::npos)
        << lines[0];
  }
}

TEST(ReadAxes, TakesADriverInUpperAndLowerCase) {
  expectIssues(linearAxis(), {{"driver", "A4988", ""}, {"driver", "Drv8825", ""}});
}

TEST(ReadAxes, ListsTheDriversAndNamesTheNearest) {
  expectIssues(
      linearAxis(),
      {{"driver", "a4899", "is \"a4899\", but must be " + kDrivers + "; did you mean a4988?"},
       {"driver", "stspin", "is \"stspin\", but must be " + kDrivers + ""},
       {"driver", 4988, "is 4988 (an integer), but must be " + kDrivers + ""}});
}

TEST(ReadAxes, NamesWhatIsMissing) {
  expectMissing(linearAxis(),
                {{"driver", kDrivers},
                 {"pins/step", "a line: chip:offset, as \"gpiochip0:17\", or a line's name"},
                 {"pins/dir", "a line: chip:offset, as \"gpiochip0:17\", or a line's name"},
                 {"microsteps", "1, 2, 4, 8 or 16"},
                 {"steps_per_mm",
                  "a number above 0, or else full_steps_per_round and mm_per_round or "
                  "wheel_diameter_mm must be given"},
                 {"max_speed_mm_s", "a number above 0"},
                 {"acceleration_mm_s2", "a number above 0"}});
  expectMissing(rotaryAxis(), {{"steps_per_degree",
                                "a number above 0, or else full_steps_per_round must be given"},
                               {"max_speed_deg_s", "a number above 0"},
                               {"acceleration_deg_s2", "a number above 0"}});
}

TEST(ReadAxes, ChecksMicrostepsAgainstTheChip) {
  expectIssues(linearAxis(),
               {{"microsteps", 32, "is 32, but must be 1, 2, 4, 8 or 16"},
                {"microsteps", 0, "is 0, but must be 1, 2, 4, 8 or 16"},
                {"microsteps", 16.0,
                 "is 16.0 (a number with a decimal point), but must be an integer: 1, "
                 "2, 4, 8 or 16"}});
  expectIssues(rotaryAxis(), {{"microsteps", 64, "is 64, but must be 1, 2, 4, 8, 16 or 32"}});
  for (const int microsteps : driver::driverChip("tb6600").microsteps) {
    ConfigValue axis = tb6600Axis();
    put(axis, "microsteps", microsteps);
    EXPECT_EQ(readX(axis).microsteps, microsteps);
  }
}

TEST(ReadAxes, WantsOneJointForEachAxis) {
  ConfigValue a = linearAxis("a");
  const ConfigValue b = linearAxis("b");
  put(a, "joint", "b");
  EXPECT_EQ(
      issuesOf(mapOf({{"a", a}, {"b", b}})),
      Lines{"/axes/b/joint: is \"b\", the axis's name, but must be another: it is the joint of "
            "/axes/a already"});
  expectIssues(linearAxis(), {{"joint", "", "is \"\", but must be the name of a joint"},
                              {"joint", 1, "is 1 (an integer), but must be a string"}});
}

TEST(ReadAxes, TakesNoNameThatCouldForgeALineOfTheLog) {
  EXPECT_EQ(issuesOf(mapOf({{"x\n[ERROR] y", linearAxis()}})),
            Lines{"/axes/x\\n[ERROR] y: has the name \"x\\n[ERROR] y\", but an axis's name must "
                  "begin with a letter and continue with letters, digits and _ only"});
  const std::string wanted =
      ", but must be a text without line breaks and other control characters";
  expectIssues(linearAxis(), {{"joint", "a\nb", "is \"a\\nb\"" + wanted},
                              {"joint", "a\x1b[2K", "is \"a\\x1b[2K\"" + wanted},
                              {"pins/step", "a\x1b[2K", "is \"a\\x1b[2K\"" + wanted},
                              {"driver", "a\nb", "is \"a\\nb\"" + wanted}});
  ConfigValue axis = linearAxis();
  put(axis, "speed\nx", 1);
  const Lines issues = issuesOf(mapOf({{"x", axis}}));
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_EQ(issues[0].rfind("/axes/x/speed\\nx: is not known", 0), 0U) << issues[0];
  put(axis = linearAxis(), "joint", "my joint-2.größe");
  EXPECT_EQ(issuesOf(mapOf({{"x", axis}})), Lines{});
}

TEST(ReadAxes, OverridesTheTimingsOfTheChip) {
  ConfigValue axis = linearAxis();
  put(axis, "timing",
      mapOf({{"step_high_us", 1.9},
             {"step_low_us", 2},
             {"dir_setup_us", 0},
             {"dir_hold_us", 0.65},
             {"mode_setup_us", 1000000},
             {"mode_hold_us", 0.2},
             {"enable_ms", 200.0},
             {"wake_ms", 1.7},
             {"reset_low_ms", 0.0},
             {"reset_wait_ms", 10000}}));
  const driver::Timing timing = readX(axis).driver.timing;
  EXPECT_EQ(timing.step_high_ns, 1900);
  EXPECT_EQ(timing.step_low_ns, 2000);
  EXPECT_EQ(timing.dir_setup_ns, 0);
  EXPECT_EQ(timing.dir_hold_ns, 650);
  EXPECT_EQ(timing.mode_setup_ns, 1000000000);
  EXPECT_EQ(timing.mode_hold_ns, 200);
  EXPECT_EQ(timing.enable_ns, 200000000);
  EXPECT_EQ(timing.wake_ns, 1700000);
  EXPECT_EQ(timing.reset_low_ns, 0);
  EXPECT_EQ(timing.reset_wait_ns, 10000000000);
}

TEST(ReadAxes, ChecksTheTimings) {
  expectIssues(
      linearAxis(),
      {{"timing/step_high_us", 0.0001, "is 0.0001, but must be from 0.001 to 1000000"},
       {"timing/step_low_us", 0, "is 0, but must be from 0.001 to 1000000"},
       {"timing/step_low_us", 0.001, ""},
       {"timing/dir_setup_us", -1.0, "is -1.0, but must be from 0 to 1000000"},
       {"timing/dir_hold_us", 1e7, "is 10000000.0, but must be from 0 to 1000000"},
       {"timing/wake_ms", 10001, "is 10001, but must be from 0 to 10000"},
       {"timing/enable_ms", "1", "is \"1\" (a string), but must be a number from 0 to 10000"},
       {"timing/step_hi_us", 1, "is not known; did you mean step_high_us?"}});
}

TEST(ReadAxes, TakesFlagsFromBooleansOnly) {
  for (const char* key : {"enable_on_start", "disable_on_shutdown", "align_on_microstep_change"}) {
    expectIssues(linearAxis(),
                 {{key, "false", "is \"false\" (a string), but must be true or false"},
                  {key, 0, "is 0 (an integer), but must be true or false"},
                  {key, true, ""}});
  }
}

TEST(ReadAxes, RejectsUnknownKeysInEveryMap) {
  expectIssues(linearAxis(),
               {{"max_sped_mm_s", 5, "is not known; did you mean max_speed_mm_s?"},
                {"micro_steps", 5, "is not known; did you mean microsteps?"},
                {"steps_per_deg", 5, "is not known; did you mean steps_per_degree?"}});
  const Lines far = [] {
    ConfigValue axis = linearAxis();
    put(axis, "xyzzyplugh", 5);
    return issuesOfX(axis);
  }();
  ASSERT_EQ(far.size(), 1U);
  EXPECT_EQ(far[0].rfind("/axes/x/xyzzyplugh: is not known; known here: acceleration_deg_s2, ", 0),
            0U)
      << far[0];
}

TEST(ReadAxes, ListsAllThatIsWrongAtOnce) {
  ConfigValue x = linearAxis("a");
  put(x, "driver", "a4989");
  put(x, "pins/step", "");
  put(x, "max_speed_mm_s", -5);
  put(x, "colour", "red");
  ConfigValue y = rotaryAxis("b");
  put(y, "microsteps", 3);
  put(y, "endstops/min/pin", "b:17");
  EXPECT_EQ(issuesOf(mapOf({{"x", x}, {"y", y}})).size(), 7U);
  const Lines lines = issuesOf(mapOf({{"x", x}, {"y", y}}));
  const Lines keys{"x/driver",     "x/pins/step",        "x/max_speed_mm_s",           "x/colour",
                   "y/microsteps", "y/endstops/min/pin", "y/endstops/min/active_level"};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    EXPECT_EQ(lines[i].rfind("/axes/" + keys[i] + ": ", 0), 0U) << lines[i];
  }
}

}  // namespace
}  // namespace stepdriver::config
