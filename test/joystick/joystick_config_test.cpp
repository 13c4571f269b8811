#include "joystick_config.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "driver_axes.h"
#include "support/config_map.h"

namespace stepdriver::joystick {
namespace {

using config::ConfigValue;
using config::drop;
using config::linesOf;
using config::mapOf;
using config::put;

using Lines = std::vector<std::string>;

ConfigValue leastConfig() {
  return mapOf({{"axes", mapOf({{"x", mapOf({{"joystick_axis", 1}, {"max_speed_mm_s", 50.0}})}})}});
}

Lines issuesOf(const ConfigValue& tree) {
  std::vector<ConfigIssue> issues;
  readJoystickConfig(tree, "/joystick", issues);
  return linesOf(issues);
}

JoystickConfig read(const ConfigValue& tree) {
  std::vector<ConfigIssue> issues;
  JoystickConfig config = readJoystickConfig(tree, "/joystick", issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  return config;
}

TEST(JoystickConfig, FillsInTheDefaults) {
  const JoystickConfig config = read(leastConfig());
  EXPECT_EQ(config.driver, "stepdriver");
  EXPECT_EQ(config.rate, 25.0);
  EXPECT_EQ(config.joy_timeout, 0.5);
  EXPECT_EQ(config.deadman_button, -1);
  ASSERT_EQ(config.axes.size(), 1U);
  const JogAxis& x = config.axes[0];
  EXPECT_EQ(x.name, "x");
  EXPECT_EQ(x.joystick_axis, 1);
  EXPECT_EQ(x.stick.max_speed, 0.05);
  EXPECT_EQ(x.stick.dead_band, 0.1);
  EXPECT_EQ(x.stick.exponent, 1.0);
  EXPECT_FALSE(x.stick.inverted);
  EXPECT_FALSE(x.disable_in_dead_band);
  EXPECT_EQ(x.disable_after, 1.0);
}

TEST(JoystickConfig, ReadsAllThatIsGiven) {
  ConfigValue tree = leastConfig();
  put(tree, "driver", "/cell/motors");
  put(tree, "rate", 50);
  put(tree, "joy_timeout", 0.2);
  put(tree, "deadman_button", 4);
  put(tree, "axes/x/inverted", true);
  put(tree, "axes/x/dead_band", 0.25);
  put(tree, "axes/x/exponent", 2);
  put(tree, "axes/x/disable_in_dead_band", true);
  put(tree, "axes/x/disable_after_s", 3.5);
  put(tree, "axes/r", mapOf({{"joystick_axis", 3}, {"max_speed_deg_s", 90}}));
  const JoystickConfig config = read(tree);
  EXPECT_EQ(config.driver, "/cell/motors");
  EXPECT_EQ(config.rate, 50.0);
  EXPECT_EQ(config.joy_timeout, 0.2);
  EXPECT_EQ(config.deadman_button, 4);
  ASSERT_EQ(config.axes.size(), 2U);
  EXPECT_NEAR(config.axes[0].stick.max_speed, 1.5707963267948966, 1e-15) << "r, in rad/s";
  const JogAxis& x = config.axes[1];
  EXPECT_TRUE(x.stick.inverted);
  EXPECT_EQ(x.stick.dead_band, 0.25);
  EXPECT_EQ(x.stick.exponent, 2.0);
  EXPECT_TRUE(x.disable_in_dead_band);
  EXPECT_EQ(x.disable_after, 3.5);
}

struct Bad {
  std::string path;
  ConfigValue value;
  std::string message;
};

TEST(JoystickConfig, NamesWhatIsWrongAndWhatIsAllowed) {
  const std::vector<Bad> all = {
      {"driver", 5, "is 5 (an integer), but must be a string"},
      {"rate", 0.5, "is 0.5, but must be from 1 to 1000"},
      {"joy_timeout", 0.0, "is 0.0, but must be from 0.02 to 60"},
      {"deadman_button", -2, "is -2, but must be from -1 to 255"},
      {"dedman_button", 2, "is not known; did you mean deadman_button?"},
      {"axes", 5, "is 5 (an integer), but must be a map"},
      {"axes", ConfigValue::Map{}, "is empty, but must be a map of at least one axis"},
      {"axes/x", "fast", "is \"fast\" (a string), but must be a map"},
      {"axes/x/joystick_axis", -1, "is -1, but must be from 0 to 255"},
      {"axes/x/joystick_axis", 1.0,
       "is 1.0 (a number with a decimal point), but must be an integer from 0 to 255"},
      {"axes/x/max_speed_mm_s", 0.0, "is 0.0, but must be above 0"},
      {"axes/x/max_speed_deg_s", 90.0,
       "is 90.0, but max_speed_mm_s must not be given with it: an axis is linear or rotary"},
      {"axes/x/inverted", "no", "is \"no\" (a string), but must be true or false"},
      {"axes/x/dead_band", 1.0, "is 1.0, but must be from 0 to 0.99"},
      {"axes/x/dead_band", -0.1, "is -0.1, but must be from 0 to 0.99"},
      {"axes/x/exponent", 0.0, "is 0.0, but must be from 0.1 to 10"},
      {"axes/x/disable_in_dead_band", 1, "is 1 (an integer), but must be true or false"},
      {"axes/x/disable_after_s", -1.0, "is -1.0, but must be from 0 to 3600"},
      {"axes/x/deadband", 0.1, "is not known; did you mean dead_band?"}};
  for (const Bad& bad : all) {
    ConfigValue tree = leastConfig();
    put(tree, bad.path, bad.value);
    EXPECT_EQ(issuesOf(tree), Lines{"/joystick/" + bad.path + ": " + bad.message});
  }
}

TEST(JoystickConfig, NamesWhatIsMissing) {
  EXPECT_EQ(issuesOf(ConfigValue::Map{}),
            Lines{"/joystick/axes: is missing; it must be a map of at least one axis"});
  EXPECT_EQ(issuesOf(5), Lines{"/joystick: is 5 (an integer), but must be a map"});
  ConfigValue tree = leastConfig();
  drop(tree, "axes/x/joystick_axis");
  drop(tree, "axes/x/max_speed_mm_s");
  EXPECT_EQ(
      issuesOf(tree),
      (Lines{"/joystick/axes/x/joystick_axis: is missing; it must be an integer from 0 to 255",
             "/joystick/axes/x/max_speed_mm_s: is missing; it, or max_speed_deg_s of a "
             "rotary axis, must be a number above 0"}));
}

TEST(JoystickConfig, RefusesNamesThatNoAxisHas) {
  const ConfigValue tree = mapOf(
      {{"axes", mapOf({{"x-axis", mapOf({{"joystick_axis", 1}, {"max_speed_mm_s", 50.0}})}})}});
  EXPECT_EQ(issuesOf(tree),
            Lines{"/joystick/axes/x-axis: has the name \"x-axis\", but an axis's name must begin "
                  "with a letter and continue with letters, digits and _ only"});
}

TEST(DriverAxes, MustHaveWhatTheJoystickJogs) {
  ConfigValue tree = leastConfig();
  put(tree, "axes/r", mapOf({{"joystick_axis", 3}, {"max_speed_deg_s", 90}}));
  const JoystickConfig config = read(tree);
  const auto misfits = [&config](const ConfigValue& driver_axes) {
    std::vector<ConfigIssue> issues;
    checkDriverAxes(config, "/joystick", driver_axes, "/stepdriver", issues);
    return linesOf(issues);
  };
  ConfigValue axes = mapOf({{"x", mapOf({{"max_speed_mm_s", 50}})},
                            {"r", mapOf({{"max_speed_deg_s", 180.0}})},
                            {"z", mapOf({{"max_speed_mm_s", 5.0}})}});
  EXPECT_EQ(misfits(axes), Lines{});
  EXPECT_EQ(misfits({}), Lines{}) << "not known yet";
  put(axes, "x/max_speed_mm_s", 49.5);
  EXPECT_EQ(misfits(axes), Lines{"/joystick/axes/x/max_speed_mm_s: is 50.0, but must be at most "
                                 "/stepdriver/axes/x/max_speed_mm_s, which is 49.5"});
  put(axes, "x/max_speed_mm_s", 100);
  drop(axes, "r/max_speed_deg_s");
  put(axes, "r/max_speed_mm_s", 100);
  EXPECT_EQ(misfits(axes),
            Lines{"/joystick/axes/r/max_speed_deg_s: must be max_speed_mm_s, because there is a "
                  "/stepdriver/axes/r/max_speed_mm_s"});
  drop(axes, "r");
  EXPECT_EQ(misfits(axes), Lines{"/joystick/axes/r: isn't an axis of /stepdriver, which has x, z"});
}

}  // namespace
}  // namespace stepdriver::joystick
