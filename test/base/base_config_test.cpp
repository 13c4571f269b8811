#include "base_config.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "driver_wheels.h"
#include "support/config_map.h"

namespace stepdriver::base {
namespace {

using config::ConfigValue;
using config::drop;
using config::linesOf;
using config::mapOf;
using config::put;

using Lines = std::vector<std::string>;
using List = ConfigValue::List;

ConfigValue twoWheeled() {
  return mapOf({{"separation_mm", 300.0},
                {"wheels", mapOf({{"left", mapOf({{"side", "left"}})},
                                  {"right", mapOf({{"side", "right"}})}})}});
}

ConfigValue threeWheeled() {
  return mapOf({{"wheels", mapOf({{"front", mapOf({{"side", "steered"}, {"diameter_mm", 80}})}})},
                {"steering", mapOf({{"axis", "steer"}, {"wheelbase_mm", 400.0}})}});
}

BaseConfig parse(const ConfigValue& tree, std::vector<ConfigIssue>& issues) {
  return readBaseConfig(tree, "/base", issues);
}

Lines issuesOf(const ConfigValue& tree) {
  std::vector<ConfigIssue> issues;
  parse(tree, issues);
  return linesOf(issues);
}

BaseConfig read(const ConfigValue& tree) {
  std::vector<ConfigIssue> issues;
  BaseConfig config = parse(tree, issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  return config;
}

config::AxisConfig axisOf(const std::string& name, config::Kind kind) {
  config::AxisConfig axis;
  axis.name = name;
  axis.joint = name + "_joint";
  axis.kind = kind;
  axis.max_speed = 2.0;
  axis.acceleration = 3.0;
  axis.deceleration = 4.0;
  return axis;
}

/// A driver with linear axes left and right, and rotary ones front and steer.
ros_node::NodeConfig driver() {
  ros_node::NodeConfig config;
  config.axes = {axisOf("front", config::Kind::kRotary), axisOf("left", config::Kind::kLinear),
                 axisOf("right", config::Kind::kLinear), axisOf("steer", config::Kind::kRotary)};
  return config;
}

Lines misfits(const ConfigValue& tree, const ros_node::NodeConfig& driver_config = driver()) {
  std::vector<ConfigIssue> issues;
  driverWheels(read(tree), "/base", driver_config, "/stepdriver", issues);
  return linesOf(issues);
}

TEST(BaseConfig, FillsInTheDefaults) {
  const BaseConfig config = read(twoWheeled());
  EXPECT_EQ(config.driver, "stepdriver");
  EXPECT_EQ(config.rate, 25.0);
  EXPECT_EQ(config.cmd_vel_timeout, 0.5);
  EXPECT_EQ(config.driver_timeout, 0.5);
  EXPECT_EQ(config.odom_frame, "odom");
  EXPECT_EQ(config.base_frame, "base_link");
  EXPECT_TRUE(config.publish_tf);
  EXPECT_EQ(config.pose_variances, Variances{});
  EXPECT_EQ(config.separation, 0.3);
  ASSERT_EQ(config.wheels.size(), 2U);
  EXPECT_EQ(config.wheels[1].axis, "right");
  EXPECT_EQ(config.wheels[1].side, Side::kRight);
  EXPECT_FALSE(config.wheels[1].diameter);
  EXPECT_FALSE(config.steering);
}

TEST(BaseConfig, ReadsAllThatIsGiven) {
  ConfigValue tree = threeWheeled();
  put(tree, "driver", "/car/motors");
  put(tree, "rate", 50);
  put(tree, "cmd_vel_timeout", 0.2);
  put(tree, "driver_timeout", 1);
  put(tree, "odom_frame", "world");
  put(tree, "base_frame", "car");
  put(tree, "publish_tf", false);
  put(tree, "pose_covariance_diagonal", List{0.1, 0.2, 0, 0, 0, 0.3});
  put(tree, "twist_covariance_diagonal", List{1, 2, 3, 4, 5, 6});
  put(tree, "steering/max_angle_deg", 90);
  const BaseConfig config = read(tree);
  EXPECT_EQ(config.driver, "/car/motors");
  EXPECT_EQ(config.rate, 50.0);
  EXPECT_EQ(config.cmd_vel_timeout, 0.2);
  EXPECT_EQ(config.driver_timeout, 1.0);
  EXPECT_EQ(config.odom_frame, "world");
  EXPECT_EQ(config.base_frame, "car");
  EXPECT_FALSE(config.publish_tf);
  EXPECT_EQ(config.pose_variances, (Variances{0.1, 0.2, 0.0, 0.0, 0.0, 0.3}));
  EXPECT_EQ(config.twist_variances, (Variances{1.0, 2.0, 3.0, 4.0, 5.0, 6.0}));
  ASSERT_TRUE(config.steering);
  EXPECT_EQ(config.steering->axis, "steer");
  EXPECT_EQ(config.steering->wheelbase, 0.4);
  EXPECT_NEAR(config.steering->max_angle, 1.5707963267948966, 1e-15);
  EXPECT_EQ(config.wheels.at(0).diameter.value_or(0.0), 0.08);
}

struct Bad {
  std::string path;
  ConfigValue value;
  std::string message;
};

TEST(BaseConfig, NamesWhatIsWrongAndWhatIsAllowed) {
  const std::string wanted_list = ", but must be a list of 6 numbers, each 0 or more";
  const std::vector<Bad> all = {
      {"driver", 5, "is 5 (an integer), but must be a string"},
      {"rate", 0.5, "is 0.5, but must be from 1 to 1000"},
      {"cmd_vel_timeout", 0.0, "is 0.0, but must be from 0.02 to 60"},
      {"driver_timeout", 0.1, "is 0.1, but must be from 0.2 to 60"},
      {"odom_frame", "/odom",
       "is \"/odom\", but must be the name of a frame, without a / in front"},
      {"base_frame", "", "is \"\", but must be the name of a frame, without a / in front"},
      {"base_frame", "odom", "is \"odom\", but must differ from odom_frame"},
      {"publish_tf", 1, "is 1 (an integer), but must be true or false"},
      {"publish_tff", true, "is not known; did you mean publish_tf?"},
      {"pose_covariance_diagonal", 0.1, "is 0.1" + wanted_list},
      {"pose_covariance_diagonal", List{1, 2}, "is [1, 2]" + wanted_list},
      {"twist_covariance_diagonal", List{1, 2, 3, 4, 5, -6},
       "is [1, 2, 3, 4, 5, -6]" + wanted_list},
      {"twist_covariance_diagonal", List{1, 2, 3, 4, 5, "x"},
       "is [1, 2, 3, 4, 5, \"x\"]" + wanted_list},
      {"separation_mm", -1.0, "is -1.0, but must be above 0"},
      {"wheels", 5, "is 5 (an integer), but must be a map"},
      {"wheels/left", "x", "is \"x\" (a string), but must be a map"},
      {"wheels/left/side", "top", "is \"top\", but must be left, right, middle or steered"},
      {"wheels/left/diameter_mm", 0, "is 0, but must be above 0"},
      {"wheels/left/radius_mm", 1, "is not known; known here: diameter_mm and side"},
      {"wheels", mapOf({{"left", mapOf({{"side", "left"}})}}),
       "has 1 left, 0 right, 0 middle and 0 steered, but without a steering there must be one left "
       "and one right wheel, or two of each"},
      {"steering", 5, "is 5 (an integer), but must be a map"},
  };
  for (const Bad& bad : all) {
    ConfigValue tree = twoWheeled();
    put(tree, bad.path, bad.value);
    EXPECT_EQ(issuesOf(tree), Lines{"/base/" + bad.path + ": " + bad.message});
  }
}

TEST(BaseConfig, NamesWhatIsWrongWithASteering) {
  const std::vector<Bad> all = {
      {"steering/wheelbase_mm", 0.0, "is 0.0, but must be above 0"},
      {"steering/max_angle_deg", 91, "is 91, but must be above 0 and at most 90"},
      {"wheels/rear", mapOf({{"side", "middle"}}), ""},
  };
  for (const Bad& bad : all) {
    ConfigValue tree = threeWheeled();
    put(tree, bad.path, bad.value);
    EXPECT_EQ(issuesOf(tree),
              Lines{bad.message.empty()
                        ? "/base/wheels: has 0 left, 0 right, 1 middle and 1 steered, but with a "
                          "steering there must be one steered wheel, or one in the middle, or one "
                          "left and one right"
                        : "/base/" + bad.path + ": " + bad.message});
  }
  ConfigValue tree = threeWheeled();
  put(tree, "wheels/front/side", "middle");
  put(tree, "steering/max_angle_deg", 90.0);
  EXPECT_EQ(issuesOf(tree),
            Lines{"/base/steering/max_angle_deg: is 90, but must be at most 85 with a wheel in the "
                  "middle, which doesn't turn if the steering is square to it"});
}

TEST(BaseConfig, NamesWhatIsMissing) {
  EXPECT_EQ(issuesOf(ConfigValue::Map{}),
            Lines{"/base/wheels: is missing; it must be a map of the driven wheels"});
  EXPECT_EQ(issuesOf(5), Lines{"/base: is 5 (an integer), but must be a map"});
  ConfigValue tree = twoWheeled();
  drop(tree, "separation_mm");
  drop(tree, "wheels/left/side");
  EXPECT_EQ(issuesOf(tree),
            (Lines{"/base/wheels/left/side: is missing; it must be left, right, middle or steered",
                   "/base/separation_mm: is missing; it must be a number above 0"}));
  tree = threeWheeled();
  drop(tree, "steering/axis");
  drop(tree, "steering/wheelbase_mm");
  EXPECT_EQ(issuesOf(tree),
            (Lines{"/base/steering/axis: is missing; it must be a string",
                   "/base/steering/wheelbase_mm: is missing; it must be a number above 0"}));
}

TEST(DriverWheels, HaveTheScaleAndTheLimitsOfTheirAxes) {
  std::vector<ConfigIssue> issues;
  const DriverWheels two = driverWheels(read(twoWheeled()), "/base", driver(), "/d", issues);
  ASSERT_EQ(two.kinematics.wheels.size(), 2U);
  EXPECT_EQ(two.kinematics.wheels[0].y, 0.15);
  EXPECT_EQ(two.kinematics.wheels[1].y, -0.15);
  EXPECT_EQ(two.kinematics.wheels[0].travel, 1.0) << "a linear axis";
  EXPECT_EQ(two.kinematics.wheels[0].max_speed, 2.0);
  EXPECT_EQ(two.kinematics.wheels[0].acceleration, 3.0);
  EXPECT_EQ(two.kinematics.wheels[0].deceleration, 4.0);
  EXPECT_EQ(two.wheels.at(0).joint, "left_joint");
  const DriverWheels three = driverWheels(read(threeWheeled()), "/base", driver(), "/d", issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  EXPECT_TRUE(three.kinematics.wheels.at(0).steered);
  EXPECT_EQ(three.kinematics.wheels[0].travel, 0.04) << "the radius";
  EXPECT_EQ(three.kinematics.steering.value().wheelbase, 0.4);
  EXPECT_EQ(three.steering.joint, "steer_joint");
}

TEST(DriverWheels, MustFitTheAxesOfTheDriver) {
  EXPECT_EQ(misfits(twoWheeled()), Lines{});
  ConfigValue tree = twoWheeled();
  put(tree, "wheels/left/diameter_mm", 100.0);
  EXPECT_EQ(misfits(tree),
            Lines{"/base/wheels/left/diameter_mm: must not be given: /stepdriver/axes/left is in "
                  "mm, so its position is the distance"});
  tree = twoWheeled();
  drop(tree, "wheels/right");
  put(tree, "wheels/rear/side", "right");
  EXPECT_EQ(misfits(tree), Lines{"/base/wheels/rear: isn't an axis of /stepdriver, which has "
                                 "front, left, right, steer"});
  tree = threeWheeled();
  drop(tree, "wheels/front/diameter_mm");
  EXPECT_EQ(misfits(tree),
            Lines{"/base/wheels/front/diameter_mm: is missing; it must be a number above 0, "
                  "because /stepdriver/axes/front is in degrees"});
  tree = threeWheeled();
  put(tree, "steering/axis", "left");
  EXPECT_EQ(misfits(tree), Lines{"/base/steering/axis: is left, but must be a rotary axis: "
                                 "/stepdriver/axes/left is in mm"});
  put(tree, "steering/axis", "front");
  EXPECT_EQ(misfits(tree),
            Lines{"/base/steering/axis: is front, but must be an axis that isn't a wheel"});
  put(tree, "steering/axis", "wheel");
  EXPECT_EQ(misfits(tree), Lines{"/base/steering/axis: is \"wheel\", which isn't an axis of "
                                 "/stepdriver, which has front, left, right, steer"});
}

TEST(DriverWheels, SteerOnlyAsFarAsTheAxisGoes) {
  ros_node::NodeConfig limited = driver();
  limited.axes[3].min_position = -0.5;
  limited.axes[3].max_position = 1.0;
  EXPECT_EQ(misfits(threeWheeled(), limited),
            Lines{"/base/steering/max_angle_deg: is 85, but must be at most 28.6479, because of "
                  "the limits of /stepdriver/axes/steer"});
  ConfigValue tree = threeWheeled();
  put(tree, "steering/max_angle_deg", 28.0);
  EXPECT_EQ(misfits(tree, limited), Lines{});
}

TEST(DriverWheels, NeedThreeMessagesInTheTimeoutOfAJog) {
  ConfigValue tree = twoWheeled();
  put(tree, "rate", 5.0);
  EXPECT_EQ(misfits(tree), Lines{"/base/rate: is 5, but must be at least 6, so that three messages "
                                 "arrive in /stepdriver/jog_timeout, which is 0.5 s"});
  put(tree, "rate", 6.0);
  EXPECT_EQ(misfits(tree), Lines{});
}

}  // namespace
}  // namespace stepdriver::base
