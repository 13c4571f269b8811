#include <gtest/gtest.h>

#include <string>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue brakedAxis() {
  ConfigValue axis = linearAxis();
  put(axis, "pins/enable", std::string("E"));
  put(axis, "brake/pin", std::string("B"));
  put(axis, "brake/release_ms", 60.0);
  put(axis, "brake/engage_ms", 30.5);
  return axis;
}

TEST(ReadBrake, TakesALineThatEngagesTheBrakeWithoutPower) {
  const AxisConfig config = readX(brakedAxis());
  ASSERT_TRUE(config.brake);
  EXPECT_EQ(config.brake->line, "B");
  EXPECT_TRUE(config.brake->release_level);
  EXPECT_EQ(config.brake->release_ns, 60'000'000);
  EXPECT_EQ(config.brake->engage_ns, 30'500'000);
  ConfigValue inverted = brakedAxis();
  put(inverted, "brake/release_level", std::string("low"));
  EXPECT_FALSE(readX(inverted).brake->release_level);
  EXPECT_FALSE(readX(linearAxis()).brake);
}

TEST(ReadBrake, RefusesWrongValues) {
  expectIssues(brakedAxis(),
               {{"brake/release_ms", -1.0, "is -1.0, but must be from 0 to 10000"},
                {"brake/engage_ms", 10'001.0, "is 10001.0, but must be from 0 to 10000"},
                {"brake/release_level", std::string("on"), "is \"on\", but must be low or high"},
                {"brake/pin", std::string("E"),
                 "is \"E\", which is used twice: it is /axes/x/pins/enable already, and each pin "
                 "needs a line of its own"}});
  expectMissing(brakedAxis(),
                {{"brake/pin", "a line: chip:offset, as \"gpiochip0:17\", or a line's name"},
                 {"brake/release_ms", "a number from 0 to 10000"},
                 {"brake/engage_ms", "a number from 0 to 10000"}});
}

TEST(ReadBrake, NeedsAPinThatSwitchesTheCurrent) {
  ConfigValue axis = brakedAxis();
  drop(axis, "pins/enable");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("brake",
                    "is given, but needs /axes/x/pins/enable or /axes/x/pins/sleep, and neither is "
                    "wired: it follows the motor's current, which nothing could switch"));
  put(axis, "pins/sleep", std::string("S"));
  EXPECT_TRUE(readX(axis).brake);
  drop(axis, "pins/sleep");
  put(axis, "pins/enable", 5);
  EXPECT_EQ(issuesOfX(axis).size(), 1U) << "what is wrong with the pin is said once";
}

TEST(ReadBrake, TakesAnAxisThatStaysEnabledAfterAShutdown) {
  ConfigValue axis = brakedAxis();
  put(axis, "disable_on_shutdown", false);
  EXPECT_TRUE(readX(axis).brake) << "it is engaged at the shutdown too";
}

}  // namespace
}  // namespace stepdriver::config
