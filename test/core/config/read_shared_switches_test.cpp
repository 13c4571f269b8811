#include <gtest/gtest.h>

#include <string>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue sharedSwitch(const std::string& line = "ENDS", const std::string& level = "high") {
  return mapOf({{"pin", line}, {"active_level", level}, {"shared", true}});
}

/// An axis whose ends have one line.
ConfigValue axisWithSharedEnds() {
  ConfigValue axis = linearAxis();
  put(axis, "endstops/min", sharedSwitch());
  put(axis, "endstops/max", sharedSwitch());
  put(axis, "endstops/release_mm", 2.0);
  return axis;
}

/// An axis that is homed to its min switch, on the line "ENDS".
ConfigValue homedAxis(const std::string& chip, int order) {
  ConfigValue axis = linearAxis(chip);
  put(axis, "endstops/min", sharedSwitch());
  put(axis, "homing",
      mapOf({{"switch", "min"},
             {"seek_speed_mm_s", 20.0},
             {"latch_speed_mm_s", 2.0},
             {"pull_off_mm", 2.0},
             {"max_travel_mm", 200.0},
             {"order", order}}));
  return axis;
}

TEST(ReadSharedSwitches, BothEndsOfAnAxisMayHaveOneLine) {
  AxisConfig x = readX(axisWithSharedEnds());
  EXPECT_TRUE(x.endstop_min->shared && x.endstop_max->shared);
  EXPECT_EQ(x.endstop_max->line, "ENDS");
  EXPECT_DOUBLE_EQ(x.switch_release, 0.002);
  EXPECT_FALSE(x.assumed_end_is_max);
  ConfigValue axis = axisWithSharedEnds();
  put(axis, "endstops/assumed_end", "max");
  x = readX(axis);
  EXPECT_EQ(x.assumed_end_is_max, std::optional<bool>(true));
  EXPECT_NO_THROW(checkAxes({x})) << "a program may have made it";
}

TEST(ReadSharedSwitches, BothEndsNeedTheTravelThatReleasesTheSwitch) {
  ConfigValue axis = axisWithSharedEnds();
  expectMissing(axis, {{"endstops/release_mm", "a number above 0"}});
  put(axis, "min_position_mm", 0.0);
  put(axis, "max_position_mm", 10.0);
  expectIssues(axis, {{"endstops/release_mm", 0.0, "is 0.0, but must be above 0"},
                      {"endstops/release_mm", 0.1, "is 0.1, but must be at least a full step, 0.2"},
                      {"endstops/release_mm", 0.2, ""},
                      {"endstops/release_mm", 4.999, ""},
                      {"endstops/release_mm", 5.0,
                       "is 5.0, but must be below half of the way between the soft limits, 5"},
                      {"endstops/release_deg", 2.0, "is not known; did you mean release_mm?"},
                      {"endstops/assumed_end", "top", "is \"top\", but must be min or max"}});
}

TEST(ReadSharedSwitches, ATravelIsOnlyForBothEnds) {
  const std::string only =
      "is given, but is only for a switch of both ends: endstops/min and endstops/max with one "
      "pin, and shared: true";
  ConfigValue axis = linearAxis();
  put(axis, "endstops/min", mapOf({{"pin", "MIN"}, {"active_level", "low"}}));
  expectIssues(axis, {{"endstops/release_mm", 2.0, only}, {"endstops/assumed_end", "min", only}});
}

TEST(ReadSharedSwitches, EachMustBeSharedAndNotAlone) {
  ConfigValue axis = linearAxis();
  put(axis, "endstops/min", sharedSwitch());
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("endstops/min/shared", "is true, but no other switch is on the line \"ENDS\""));
  axis = linearAxis();
  put(axis, "endstops/min", sharedSwitch());
  put(axis, "endstops/max", mapOf({{"pin", "ENDS"}, {"active_level", "high"}}));
  EXPECT_EQ(issuesOfX(axis).front(),
            "/axes/x/endstops/max/pin: is \"ENDS\", which is used twice: it is "
            "/axes/x/endstops/min/pin already, and each pin needs a line of its own, unless both "
            "are switches with shared: true");
}

TEST(ReadSharedSwitches, AxesThatShareOneAreHomedOneAfterTheOther) {
  const auto issues_of = [](int order_of_x, int order_of_y) {
    return issuesOf(
        mapOf({{"x", homedAxis("chip0", order_of_x)}, {"y", homedAxis("chip1", order_of_y)}}));
  };
  EXPECT_EQ(issues_of(0, 1), Lines{});
  EXPECT_EQ(issues_of(2, 2),
            Lines{"/axes/y/homing/order: is 2, as that of x, but must differ: a switch of each is "
                  "on the line \"ENDS\", so they are homed one after the other"});
}

TEST(ReadSharedSwitches, AllOfALineAreActiveAtOneLevel) {
  ConfigValue x = homedAxis("chip0", 0);
  ConfigValue y = homedAxis("chip1", 1);
  put(y, "endstops/min", sharedSwitch("ENDS", "low"));
  const std::string message =
      "/axes/y/endstops/min/pin: is \"ENDS\", which is /axes/x/endstops/min/pin too; switches that "
      "share a line need the same active_level and bias";
  EXPECT_EQ(issuesOf(mapOf({{"x", x}, {"y", y}})), Lines{message});
  put(y, "endstops/min", sharedSwitch());
  put(y, "endstops/min/bias", "pull_up");
  EXPECT_EQ(issuesOf(mapOf({{"x", x}, {"y", y}})), Lines{message});
}

TEST(ReadSharedSwitches, TheMotorsOfAnAxisNeedALineEach) {
  const auto motor = [](const std::string& chip) {
    return mapOf({{"pins", mapOf({{"step", chip + ":1"}, {"dir", chip + ":2"}})},
                  {"endstops", mapOf({{"min", sharedSwitch()}})}});
  };
  ConfigValue axis = linearAxis();
  drop(axis, "pins");
  put(axis, "motors", mapOf({{"left", motor("chip0")}, {"right", motor("chip1")}}));
  const std::string why =
      "is true, but each switch of an axis with several motors needs a line of its own";
  EXPECT_EQ(issuesOfX(axis), (Lines{"/axes/x/motors/left/endstops/min/shared: " + why,
                                    "/axes/x/motors/right/endstops/min/shared: " + why}));
  put(axis, "motors/left/endstops/release_mm", 2.0);
  EXPECT_NE(issuesOfX(axis).front().find("release_mm: is not known"), std::string::npos);
}

}  // namespace
}  // namespace stepdriver::config
