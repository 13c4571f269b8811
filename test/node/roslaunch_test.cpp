// Tests launch files as a newcomer starts them, one after another, while the master keeps running.
#include "support/roslaunch.h"

#include <gtest/gtest.h>
#include <ros/param.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/RigReport.h>

#include <fstream>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/node_under_test.h"
#include "support/says.h"
#include "support/temporary_file.h"

namespace stepdriver::node_test {
namespace {

/// A configuration of one axis x with 80 steps/mm.
///
/// @param more lines of the axis.
std::string axisX(const std::vector<std::string>& more = {}) {
  std::string text = R"(
simulation: {speed: 20.0}
axes:
  x:
    driver: a4988
    joint: x_joint
    pins: {step: GPIO24, dir: GPIO27, enable: GPIO22}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
    enable_on_start: true
)";
  for (const std::string& line : more) text += "    " + line + "\n";
  return text;
}

/// A file with a user's own configuration.
class Configuration : public TemporaryFile {
 public:
  explicit Configuration(const std::string& text) : TemporaryFile(".yaml") { write(text); }
  void write(const std::string& text) const { std::ofstream(path()) << text; }
  std::string argument() const { return "config:=" + path(); }
};

/// Full path of a URDF of the package.
std::string urdf(const std::string& name) {
  return std::string(STEPDRIVER_SOURCES "/urdf/") + name;
}

MoveTo::Response moveTo(double position) {
  MoveTo::Request request;
  request.position = position;
  request.wait = true;
  return callWhenThere<MoveTo>(Roslaunch::full("x/move_to"), request);
}

TEST(RoslaunchAgain, ForgetsWhatTheFileNoLongerHas) {
  const Configuration file(axisX({"invert: {dir: true}", "backlash_mm: 3.0"}));
  {
    Roslaunch launch("axis.launch", {file.argument()});
    ASSERT_TRUE(launch.isReady());
    ASSERT_TRUE(ros::param::has(Roslaunch::full("axes/x/invert")));
  }
  file.write(axisX());
  Roslaunch launch("axis.launch", {file.argument()});
  ASSERT_TRUE(launch.isReady());
  EXPECT_FALSE(ros::param::has(Roslaunch::full("axes/x/invert")));
  const auto answer = moveTo(0.01);
  EXPECT_TRUE(answer.success) << answer.message;
  const auto report = callWhenThere<RigReport>(Roslaunch::full("rig/report"));
  EXPECT_EQ(report.pulses_forward, std::vector<std::int64_t>{800}) << "without any backlash";
}

TEST(RoslaunchAgain, TakesTheUsersFileAfterTheDefaultOne) {
  {
    Roslaunch launch("axis.launch", {});
    ASSERT_TRUE(launch.isReady());
  }
  const Configuration file(axisX());  // its STEP is on the line of the other axis's endstop
  Roslaunch launch("axis.launch", {file.argument()});
  EXPECT_TRUE(launch.isReady());
}

TEST(RoslaunchModel, OfTheDemoDoesNotLimitAnotherConfiguration) {
  {
    Roslaunch demo("axis.launch", {});  // leaves its robot_description behind
    ASSERT_TRUE(demo.isReady());
  }
  const Configuration file(axisX({"min_position_mm: 0.0", "max_position_mm: 500.0"}));
  Roslaunch launch("axis.launch", {file.argument()});
  ASSERT_TRUE(launch.isReady());
  const auto answer = moveTo(0.3);
  EXPECT_TRUE(answer.success) << answer.message;
  expectSays(moveTo(0.6).message, "max_position 0.5 m, from the configuration");
}

TEST(RoslaunchModel, ThatIsGivenLimitsTheConfiguration) {
  const Configuration file(axisX());
  Roslaunch launch("axis.launch", {file.argument(), "model:=" + urdf("linear_axis.urdf")});
  ASSERT_TRUE(launch.isReady());
  expectSays(moveTo(0.3).message, "max_position 0.2 m, from robot_description");
  EXPECT_TRUE(ros::param::has(Roslaunch::space() + "/robot_description"));
}

TEST(RoslaunchOfAWrongConfiguration, EndsByItself) {
  const Configuration file(axisX({"max_sped_mm_s: 1.0"}));
  Roslaunch launch("axis.launch", {file.argument()});
  EXPECT_TRUE(launch.process().waitForExit(kBound)) << "it still runs";
  expectSays(launch.process().output(), "did you mean max_speed_mm_s?");
  expectSays(launch.process().output(), "REQUIRED process");
}

TEST(ParametersLoadedByHand, AreSaidToBeLeftOverIfTheyContradictEachOther) {
  NodeUnderTest node;
  node.set("axes/y/driver", "a4988");
  node.set("axes/y/pins/step", "x_step");
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), "used twice");
  expectSays(node.process().output(),
             "Parameters of an earlier launch may still be on the master. To delete them: rosparam "
             "delete " +
                 node.name() + "; then load yours again");
}

TEST(ParametersLoadedByHand, AreNotSaidToBeLeftOverIfOneIsMissing) {
  NodeUnderTest node;
  node.erase("axes/x/microsteps");
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), "is missing");
  EXPECT_EQ(node.process().output().find("rosparam delete"), std::string::npos);
}

}  // namespace
}  // namespace stepdriver::node_test
