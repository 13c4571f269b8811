#include <gtest/gtest.h>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

TEST(ReadPins, NamesBothPinsWhereNoneIsGiven) {
  ConfigValue axis = linearAxis();
  drop(axis, "pins");
  EXPECT_EQ(issuesOfX(axis).size(), 2U);
  put(axis, "invert/step", true);
  EXPECT_EQ(issuesOfX(axis).size(), 2U) << "what is missing is said once";
  put(axis, "pins", "gpiochip0");
  put(axis, "invert/enable", true);
  EXPECT_EQ(issuesOfX(axis), Lines{"/axes/x/pins: is \"gpiochip0\" (a string), but must be a map"});
}

TEST(ReadPins, RefusesWhatIsNoLine) {
  const std::string wanted =
      ", but must be a line: chip:offset, as \"gpiochip0:17\", or a line's name";
  for (const std::string bad :
       {"", ":17", "gpiochip0:", "gpiochip0:x", "gpiochip0:-1", "gpiochip0:1.5", "gpiochip0:0x11",
        "gpiochip0:9999999999", "gpiochip0: 17", " ", "X STEP"}) {
    expectIssues(linearAxis(), {{"pins/step", bad, "is " + ConfigValue(bad).shown() + wanted}});
  }
  expectIssues(linearAxis(), {{"pins/step", 17, "is 17 (an integer)" + wanted},
                              {"pins/enable", ConfigValue(), "is nothing" + wanted},
                              {"pins/step", "gpiochip0:0", ""},
                              {"pins/step", "1e20.gpio:0:4", ""},
                              {"pins/step", "X_STEP", ""},
                              {"pins/stp", "gpiochip0:4", "is not known; did you mean step?"},
                              {"pins/en", "gpiochip0:4", "is not known; did you mean enable?"},
                              {"pins/ena", "gpiochip0:4", "is not known; did you mean enable?"},
                              {"pins/slp", "gpiochip0:4", "is not known; did you mean sleep?"}});
}

TEST(ReadPins, WantsAllMicrostepPinsOrNone) {
  const std::string message =
      "is missing; wire all three microstep pins, or none if the board is strapped to "
      "`microsteps` (wired: ";
  ConfigValue axis = linearAxis();
  put(axis, "pins/ms1", "A");
  EXPECT_EQ(issuesOfX(axis), Lines{"/axes/x/pins/ms2: " + message + "ms1)"});
  put(axis, "pins/ms3", "B");
  EXPECT_EQ(issuesOfX(axis), Lines{"/axes/x/pins/ms2: " + message + "ms1 and ms3)"});
  put(axis, "pins/ms2", "C");
  EXPECT_EQ(issuesOfX(axis), Lines{});
  ConfigValue other = rotaryAxis();
  put(other, "pins/m1", "A");
  EXPECT_EQ(issuesOfX(other), Lines{"/axes/x/pins/m0: " + message + "m1)"});
}

TEST(ReadPins, TakesEitherNameOfAMicrostepPinOnTheDrv8825) {
  ConfigValue axis = rotaryAxis();
  put(axis, "pins/m0", "A");
  put(axis, "pins/ms2", "B");
  put(axis, "pins/m2", "C");
  put(axis, "invert/ms1", true);
  const AxisConfig config = readX(axis);
  EXPECT_EQ(config.pins.ms1.line, "A");
  EXPECT_TRUE(config.pins.ms1.inverted);
  EXPECT_EQ(config.pins.ms2.line, "B");
  expectIssues(axis,
               {{"pins/m1", "D", "is \"D\", but ms2, the same pin, is given too; give one"},
                {"invert/m0", true, "is true, but ms1, the same pin, is given too; give one"}});
}

TEST(ReadPins, KeepsTheNamesOfTheDrv8825FromTheA4988) {
  ConfigValue wired = linearAxis();
  for (const char* pin : {"ms1", "ms2", "ms3"}) put(wired, std::string("pins/") + pin, pin);
  expectIssues(wired, {{"invert/m1", true, "is not known; did you mean ms1?"}});

  ConfigValue axis = linearAxis();
  for (const char* pin : {"m0", "m1", "m2"}) put(axis, std::string("pins/") + pin, pin);
  EXPECT_EQ(issuesOfX(axis),
            (Lines{"/axes/x/pins/m0: is \"m0\", but the A4988 has no M0 to M2; on it the pin "
                   "is ms1",
                   "/axes/x/pins/m1: is \"m1\", but the A4988 has no M0 to M2; on it the pin "
                   "is ms2",
                   "/axes/x/pins/m2: is \"m2\", but the A4988 has no M0 to M2; on it the pin "
                   "is ms3"}));
}

TEST(ReadPins, SaysWhyATb6600HasNoSuchPin) {
  const std::string no_ms =
      "is \"A\", but the TB6600 has no microstep pins: its microsteps are set by switches";
  expectIssues(tb6600Axis(), {{"pins/ms1", "A", no_ms},
                              {"pins/m2", "A", no_ms},
                              {"pins/sleep", "A", "is \"A\", but the TB6600 has no SLEEP pin"},
                              {"pins/reset", "A", "is \"A\", but the TB6600 has no RESET pin"},
                              {"pins/enable", "A", ""}});
}

TEST(ReadPins, InvertsWiredPinsOnly) {
  expectIssues(
      linearAxis(),
      {{"invert/dir", true, ""},
       {"invert/dir", 1, "is 1 (an integer), but must be true or false"},
       {"invert/enable", false,
        "is false, but only a wired pin may be named here; /axes/x/pins/enable is missing"},
       {"invert/ms1", true,
        "is true, but only a wired pin may be named here; /axes/x/pins/ms1 is missing"},
       {"invert/enabel", true, "is not known; did you mean enable?"},
       {"invert", true, "is true (a boolean), but must be a map"}});
}

TEST(ReadPins, TurnsOnlyTheDirectionOfACommonAnodeTb6600) {
  ConfigValue axis = tb6600Axis();
  put(axis, "pins/enable", "gpiochip0:22");
  put(axis, "common_anode", true);
  const std::string message =
      ", but common_anode inverts it already; with common_anode only dir may be named here, to "
      "reverse the direction";
  expectIssues(axis, {{"invert/step", false, "is false" + message},
                      {"invert/enable", true, "is true" + message},
                      {"invert/dir", true, ""},
                      {"common_anode", "yes", "is \"yes\" (a string), but must be true or false"}});
  put(axis, "invert/dir", true);
  EXPECT_FALSE(readX(axis).pins.dir.inverted);
  EXPECT_TRUE(readX(axis).pins.step.inverted);
  put(axis, "invert/dir", false);
  EXPECT_TRUE(readX(axis).pins.dir.inverted);
}

TEST(ReadPins, KeepsCommonAnodeForTheTb6600) {
  expectIssues(
      linearAxis(),
      {{"common_anode", false, ""},
       {"common_anode", true,
        "is true, but must be false on the A4988: only inputs with optocouplers, such as a "
        "tb6600's, are wired so; for single pins there is invert"}});
}

TEST(ReadPins, ChecksTheEndstops) {
  ConfigValue axis = linearAxis();
  put(axis, "endstops/min", mapOf({{"pin", "A"}, {"active_level", "high"}}));
  expectIssues(
      axis,
      {{"endstops/min/active_level", "hihg",
        "is \"hihg\", but must be low or high; did you mean high?"},
       {"endstops/min/active_level", 0, "is 0 (an integer), but must be low or high"},
       {"endstops/min/pull", "up", "is not known; known here: active_level, bias, pin and shared"},
       {"endstops/mid", "A", "is not known; did you mean min?"},
       {"endstops/max", "A", "is \"A\" (a string), but must be a map"}});
  expectMissing(
      axis, {{"endstops/min/active_level", "low or high"},
             {"endstops/min/pin", "a line: chip:offset, as \"gpiochip0:17\", or a line's name"}});
}

TEST(ReadPins, ReadsTheFaultPinOfAChipThatHasOne) {
  ConfigValue axis = linearAxis();
  put(axis, "driver", "drv8825");
  put(axis, "pins/fault", "GPIO4");
  put(axis, "fault_bias", "pull_up");
  put(axis, "endstops/min", mapOf({{"pin", "A"}, {"active_level", "high"}, {"bias", "pull_down"}}));
  const AxisConfig config = readX(axis);
  ASSERT_TRUE(config.fault);
  EXPECT_EQ(config.fault->line, "GPIO4");
  EXPECT_EQ(config.fault->bias, Bias::kPullUp);
  ASSERT_TRUE(config.endstop_min);
  EXPECT_EQ(config.endstop_min->bias, Bias::kPullDown);

  put(axis, "driver", "a4988");
  EXPECT_EQ(issuesOfX(axis), Lines{"/axes/x/pins/fault: is \"GPIO4\", but the A4988 has no "
                                   "fault pin"});
}

TEST(ReadPins, RefusesWhatBelongsToAPinThatIsMissing) {
  const std::vector<std::pair<std::string, ConfigValue>> keys = {{"fault_bias", "pull_up"},
                                                                 {"fault_stop", "ramp"},
                                                                 {"in_position_bias", "pull_up"},
                                                                 {"in_position_timeout_ms", 200.0}};
  for (const auto& [key, value] : keys) {
    ConfigValue axis = linearAxis();
    put(axis, key, value);
    const std::string pin = key.rfind("fault", 0) == 0 ? "fault" : "in_position";
    EXPECT_EQ(issuesOfX(axis),
              lineOfX(key, "is " + value.shown() + ", but pins/" + pin + " is missing"));
  }
}

TEST(ReadPins, ReadsTheInPositionPinOfADriverThatHasOne) {
  ConfigValue axis = tb6600Axis();
  put(axis, "driver", "cl57t");
  put(axis, "pins/in_position", "GPIO4");
  EXPECT_EQ(readX(axis).in_position->timeout, 1.0);
  put(axis, "in_position_bias", "pull_up");
  put(axis, "in_position_timeout_ms", 250);
  put(axis, "pins/fault", "GPIO5");
  put(axis, "fault_stop", "ramp");
  const AxisConfig config = readX(axis);
  ASSERT_TRUE(config.in_position && config.fault);
  EXPECT_EQ(config.in_position->line, "GPIO4");
  EXPECT_EQ(config.in_position->bias, Bias::kPullUp);
  EXPECT_EQ(config.in_position->timeout, 0.25);
  EXPECT_TRUE(config.fault_ramps);
  expectIssues(axis, {{"in_position_timeout_ms", 0, "is 0, but must be above 0 and at most 60000"},
                      {"fault_stop", "slowly", "is \"slowly\", but must be at_once or ramp"}});
  put(axis, "driver", "tb6600");
  drop(axis, "pins/fault");
  drop(axis, "fault_stop");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("pins/in_position", "is \"GPIO4\", but the TB6600 has no in-position output"));
}

TEST(ReadPins, UsesEachLineOnce) {
  const std::string twice = "is \"gpiochip0:17\", which is used twice: it is ";
  const std::string rest = " already, and each pin needs a line of its own";
  ConfigValue axis = linearAxis();
  put(axis, "pins/enable", "gpiochip0:17");
  put(axis, "endstops/max", mapOf({{"pin", "gpiochip0:17"}, {"active_level", "low"}}));
  EXPECT_EQ(issuesOfX(axis),
            (Lines{"/axes/x/pins/enable: " + twice + "/axes/x/pins/step" + rest,
                   "/axes/x/endstops/max/pin: " + twice + "/axes/x/pins/step" + rest}));

  ConfigValue a = linearAxis("a");
  ConfigValue b = linearAxis("b");
  put(a, "pins/enable", "EN");
  put(b, "pins/dir", "EN");
  EXPECT_EQ(
      issuesOf(mapOf({{"a", a}, {"b", b}})),
      Lines{"/axes/b/pins/dir: is \"EN\", which is used twice: it is /axes/a/pins/enable" + rest});
}

TEST(ReadPins, LetsAxesShareAnEnableLineOfOneLevel) {
  ConfigValue a = linearAxis("a");
  ConfigValue b = linearAxis("b");
  put(a, "pins/enable", "EN");
  put(b, "pins/enable", "EN");
  const auto both = [&] { return issuesOf(mapOf({{"a", a}, {"b", b}})); };
  EXPECT_EQ(both(), Lines{});
  put(b, "invert/enable", true);
  EXPECT_EQ(both(),
            Lines{"/axes/b/pins/enable: is \"EN\", which is /axes/a/pins/enable too, but its axis "
                  "is enabled by high and the other by low; axes that share a line need the same "
                  "level"});
  put(a, "invert/enable", true);
  EXPECT_EQ(both(), Lines{});
}

}  // namespace
}  // namespace stepdriver::config
