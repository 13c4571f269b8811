#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "support/axis_config.h"

// Axes with several motors.

namespace stepdriver::config {
namespace {

ConfigValue motorAt(const std::string& chip) {
  return mapOf(
      {{"pins", mapOf({{"step", chip + ":1"}, {"dir", chip + ":2"}, {"enable", chip + ":3"}})},
       {"endstops", mapOf({{"min", mapOf({{"pin", chip + ":4"}, {"active_level", "low"}})}})}});
}

ConfigValue gantry() {
  ConfigValue axis = linearAxis();
  drop(axis, "pins");
  put(axis, "motors/left", motorAt("l"));
  put(axis, "motors/right", motorAt("r"));
  put(axis, "max_skew_mm", 5.0);
  put(axis, "homing",
      mapOf({{"switch", "min"},
             {"seek_speed_mm_s", 10.0},
             {"latch_speed_mm_s", 0.5},
             {"pull_off_mm", 2.0},
             {"max_travel_mm", 300.0}}));
  return axis;
}

TEST(ReadMotors, TakesTheirPinsSwitchesAndOffsets) {
  ConfigValue axis = gantry();
  put(axis, "motors/right/invert/dir", true);
  put(axis, "motors/right/offset_mm", -0.5);
  const AxisConfig config = readX(axis);
  ASSERT_EQ(config.motors(), 2U);
  EXPECT_EQ(config.motor, "left");
  EXPECT_EQ(config.pins.step.line, "l:1");
  EXPECT_EQ(config.endstop_min->line, "l:4");
  EXPECT_EQ(config.offset, 0.0);
  const MotorConfig& right = config.twins[0];
  EXPECT_EQ(right.motor, "right");
  EXPECT_EQ(right.pins.dir.line, "r:2");
  EXPECT_TRUE(right.pins.dir.inverted);
  EXPECT_EQ(right.endstop_min->line, "r:4");
  EXPECT_DOUBLE_EQ(right.offset, -0.0005);
  EXPECT_DOUBLE_EQ(config.max_skew, 0.005);
  EXPECT_EQ(config.traceName(0), "x");
  EXPECT_EQ(config.traceName(1), "x.right");
}

TEST(ReadMotors, MayShareALineForEnableOnly) {
  ConfigValue axis = gantry();
  put(axis, "motors/right/pins/enable", "l:3");
  EXPECT_EQ(issuesOfX(axis), Lines{});
  put(axis, "motors/right/pins/step", "l:1");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors/right/pins/step",
                    "is \"l:1\", which is used twice: it is /axes/x/motors/left/pins/step already, "
                    "and each pin needs a line of its own"));
}

TEST(ReadMotors, HaveTheSamePinsWired) {
  ConfigValue axis = gantry();
  drop(axis, "motors/right/pins/enable");
  EXPECT_EQ(
      issuesOfX(axis),
      lineOfX("motors/right",
              "has no pins/enable, but must have one, because /axes/x/motors/left has one: the "
              "motors of an axis are switched together"));
}

ConfigValue withDrivers(const char* left, const char* right) {
  ConfigValue axis = gantry();
  drop(axis, "driver");
  put(axis, "motors/left/driver", left);
  put(axis, "motors/right/driver", right);
  return axis;
}

TEST(ReadMotors, HaveTheDriverOfTheAxisOrTheirOwn) {
  ConfigValue axis = gantry();
  put(axis, "motors/right/driver", "tmc2209");
  put(axis, "timing/step_high_us", 3.0);
  put(axis, "motors/right/timing/dir_setup_us", 7.0);
  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.driver.name, "a4988");
  EXPECT_EQ(config.twins[0].driver.name, "tmc2209");
  EXPECT_EQ(config.driver.timing.step_high_ns, 3'000);
  EXPECT_EQ(config.twins[0].driver.timing.step_high_ns, 200);
  EXPECT_EQ(config.driverTitles(), "A4988 and TMC2209");
  const driver::Timing longest = config.timing();
  EXPECT_EQ(longest.step_high_ns, 3'000);
  EXPECT_EQ(longest.step_low_ns, 1'000);
  EXPECT_EQ(longest.dir_setup_ns, 7'000);
  EXPECT_EQ(longest.dir_hold_ns, 200);
  EXPECT_EQ(longest.enable_ns, 1'000'000);
  EXPECT_EQ(config.shortestStepNs(), 4'000);
  const AxisConfig own = readX(withDrivers("drv8825", "drv8825"));
  EXPECT_EQ(own.driverTitles(), "DRV8825");
}

TEST(ReadMotors, HaveTheDriverOfTheAxisIfTheyDescribeNone) {
  ConfigValue axis = gantry();
  put(axis, "motors/right/timing/step_high_us", 3.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors/right/timing",
                    "is given, but needs /axes/x/motors/right/driver: without a driver of its "
                    "own, the motor has /axes/x/timing"));
  axis = withDrivers("a4988", "tmc2209");
  put(axis, "timing/step_high_us", 3.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("timing", "is given, but each of motors has a driver of its own"));
  axis = gantry();
  drop(axis, "driver");
  put(axis, "motors/right/driver", "a4988");
  ASSERT_EQ(issuesOfX(axis).size(), 1U);
  EXPECT_EQ(issuesOfX(axis)[0].rfind("/axes/x/driver: is missing", 0), 0U) << issuesOfX(axis)[0];
  axis = withDrivers("a4988", "a4989");
  ASSERT_EQ(issuesOfX(axis).size(), 1U);
  EXPECT_EQ(issuesOfX(axis)[0].rfind("/axes/x/motors/right/driver: is \"a4989\"", 0), 0U)
      << issuesOfX(axis)[0];
}

TEST(ReadMotors, HaveMicrostepsThatEachDriverHas) {
  ConfigValue axis = withDrivers("a4988", "tmc2209");
  EXPECT_EQ(issuesOfX(axis), Lines{});
  put(axis, "microsteps", 4);
  EXPECT_EQ(issuesOfX(axis), lineOfX("microsteps", "is 4, but must be 8 or 16"));
  axis = withDrivers("a4988", "step_dir");
  put(axis, "motors/right/chip/microstep_codes", "5 L, 10 H");
  put(axis, "motors/right/chip/enable_active", "low");
  put(axis, "motors/right/timing",
      mapOf({{"step_high_us", 1.0},
             {"step_low_us", 1.0},
             {"dir_setup_us", 1.0},
             {"dir_hold_us", 1.0},
             {"mode_setup_us", 1.0},
             {"mode_hold_us", 1.0},
             {"enable_ms", 1.0}}));
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors", "have drivers with no number of microsteps in common"));
}

TEST(ReadMotors, HaveMicrostepPinsThatSelectTheMode) {
  ConfigValue axis = withDrivers("a4988", "drv8434");
  put(axis, "motors/right/pins/m0", "r:8");
  put(axis, "motors/right/pins/m1", "r:9");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("microsteps",
                    "is 16, but with the microstep pins wired it must be 1, 2, 4 or 8: lines that "
                    "are high or low select no other mode of the DRV8434"));
}

TEST(ReadMotors, StepOnTheSameEdges) {
  ConfigValue axis = withDrivers("a4988", "tmc2209");
  put(axis, "motors/right/chip/step_edges", "both");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors/right",
                    "has a driver, TMC2209, that steps on both edges of STEP, but must have one "
                    "like that of /axes/x/motors/left, A4988, that steps on one edge of STEP: the "
                    "motors of an axis get the same edges"));
  put(axis, "motors/left/chip/step_edges", "both");
  EXPECT_EQ(issuesOfX(axis), Lines{});
}

TEST(ReadMotors, AreAsFastAsTheSlowestDriver) {
  ConfigValue axis = withDrivers("tmc2209", "dm542");
  put(axis, "max_speed_mm_s", 2500.0);
  EXPECT_EQ(issuesOfX(axis), Lines{});
  put(axis, "max_speed_mm_s", 2501.0);
  EXPECT_EQ(
      issuesOfX(axis),
      lineOfX(
          "max_speed_mm_s",
          "is 2501.0, but must be at most 2500: it is 200080 steps/s (at 80 steps per "
          "mm), and the TMC2209 and DM542 together take at most 200000 steps/s (2.5 us high, 2.5 "
          "us low)"));
  put(axis, "max_speed_mm_s", 2000.0);
  put(axis, "motors/right/timing/dir_hold_us", 8.0);
  ASSERT_EQ(issuesOfX(axis).size(), 1U);
  EXPECT_EQ(issuesOfX(axis)[0].rfind("/axes/x/motors/right/timing/dir_hold_us: is 8, but", 0), 0U)
      << issuesOfX(axis)[0];
}

TEST(ReadMotors, MayHaveAFaultPinOnOneDriverOnly) {
  ConfigValue axis = withDrivers("a4988", "tmc2209");
  put(axis, "motors/right/pins/fault", "r:7");
  const AxisConfig config = readX(axis);
  EXPECT_FALSE(config.fault);
  EXPECT_EQ(config.twins[0].fault->line, "r:7");
  put(axis, "motors/left/pins/fault", "l:7");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors/left/pins/fault", "is \"l:7\", but the A4988 has no fault pin"));
}

TEST(ReadMotors, AreNotGivenBesideTheAxissOwnPins) {
  ConfigValue axis = gantry();
  put(axis, "pins", mapOf({{"step", "a:1"}, {"dir", "a:2"}}));
  EXPECT_EQ(
      issuesOfX(axis),
      lineOfX("pins", "is given, but must stand in each of motors, because there are several"));
}

TEST(ReadMotors, AreTwoToFour) {
  ConfigValue axis = gantry();
  drop(axis, "motors/right");
  drop(axis, "max_skew_mm");
  const std::string but =
      " motors, but must have 2 to 4; a single one is configured without motors";
  EXPECT_EQ(issuesOfX(axis), lineOfX("motors", "has 1" + but));
  axis = gantry();
  for (const char* name : {"a", "b", "c"}) put(axis, std::string("motors/") + name, motorAt(name));
  EXPECT_EQ(issuesOfX(axis), lineOfX("motors", "has 5" + but));
}

TEST(ReadMotors, HaveNamesThatMessagesAndTracesCanShow) {
  ConfigValue axis = gantry();
  put(axis, "motors/1 right", motorAt("s"));
  drop(axis, "motors/right");
  EXPECT_EQ(issuesOfX(axis).size(), 1U);
  EXPECT_NE(issuesOfX(axis)[0].find("begin with a letter"), std::string::npos);
}

TEST(ReadMotors, HaveASwitchEachOrOneTogether) {
  ConfigValue axis = gantry();
  drop(axis, "motors/right/endstops");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("max_skew_mm",
                    "is given, but is only for several motors that a homing squares, "
                    "each with a switch at the home end"));
  drop(axis, "max_skew_mm");
  EXPECT_EQ(issuesOfX(axis), Lines{});
  put(axis, "motors/third", motorAt("t"));
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("motors",
                    "has 2 motors with a switch at the home end, but must have 3, to be "
                    "squared, or 1"));
}

TEST(ReadMotors, NeedABoundToBeSquared) {
  expectMissing(gantry(), {{"max_skew_mm", "a number above 0"}});
  expectIssues(gantry(), {{"max_skew_mm", 0.0, "is 0.0, but must be above 0"}});
}

TEST(ReadMotors, HaveOffsetsWithinThePullOffAndHalfOfTheSkew) {
  const std::string must =
      ", but must be from -2 to 2: at most the homing's pull-off and half of max_skew_mm";
  expectIssues(gantry(), {{"motors/left/offset_mm", 2.0, ""},
                          {"motors/left/offset_mm", 2.1, "is 2.1" + must},
                          {"motors/right/offset_mm", -2.1, "is -2.1" + must}});
  ConfigValue axis = gantry();
  put(axis, "backlash_mm", 0.1);
  put(axis, "motors/right/offset_mm", 0.1);
  EXPECT_EQ(
      issuesOfX(axis),
      lineOfX("motors/right/offset_mm",
              "is 0.1, but must be 0 if there is /axes/x/backlash_mm: one motor can't be moved "
              "alone by less than its backlash"));
}

TEST(ReadMotors, AreAMap) {
  ConfigValue axis = gantry();
  put(axis, "motors", 2);
  ASSERT_FALSE(issuesOfX(axis).empty());
  EXPECT_EQ(issuesOfX(axis)[0].rfind("/axes/x/motors: is 2 (an integer), but must be a map", 0), 0U)
      << issuesOfX(axis)[0];
}

}  // namespace
}  // namespace stepdriver::config
