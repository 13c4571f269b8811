#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "support/cut_connections.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using nav_msgs::Odometry;
using sensor_msgs::JointState;

constexpr double kWheelStep = 0.1 * kPi / 3200.0;  // [m] of a wheel of 100 mm at 3200 steps
constexpr double kSeparation = 0.3;                // [m]

double yawOf(const Odometry& odometry) {
  return 2.0 * std::atan2(odometry.pose.pose.orientation.z, odometry.pose.pose.orientation.w);
}

/// A stepdriver_base on two wheels left and right of a node under test, 300 mm apart.
class BaseTest : public testing::Test {
 protected:
  BaseTest() {
    node.set("simulation/speed", 1.0);
    node.erase("axes/x");
    for (const char* name : {"left", "right"}) addWheel(name);
    set("separation_mm", 300.0);
    set("wheels/left/side", "left");
    set("wheels/right/side", "right");
  }
  void TearDown() override {
    if (!base) return;
    base->signal(SIGTERM);
    EXPECT_EQ(base->waitForExit(kBound).value_or(-1), 0);
    if (HasFailure()) std::fputs(base->output().c_str(), stderr);
  }

  void addAxis(const std::string& name) {
    const std::string axis = "axes/" + name + "/";
    node.set(axis + "driver", "a4988");
    for (const char* pin : {"step", "dir", "enable"}) {
      node.set(axis + "pins/" + pin, name + "_" + pin);
    }
    node.set(axis + "microsteps", 16);
    node.set(axis + "full_steps_per_round", 200);
    node.set(axis + "enable_on_start", true);
  }

  void addWheel(const std::string& name) {
    addAxis(name);
    const std::string axis = "axes/" + name + "/";
    node.set(axis + "wheel_diameter_mm", 100.0);
    node.set(axis + "max_speed_mm_s", 500.0);
    node.set(axis + "acceleration_mm_s2", 1000.0);
  }

  /// Instead of the two wheels, one that also steers, on rotary axes.
  void makeTricycle() {
    node.erase("axes");
    ros::param::del(node.beside("base"));
    for (const char* name : {"front", "steer"}) {
      addAxis(name);
      node.set(std::string("axes/") + name + "/max_speed_deg_s", 720.0);
      node.set(std::string("axes/") + name + "/acceleration_deg_s2", 3600.0);
    }
    set("wheels/front/side", "steered");
    set("wheels/front/diameter_mm", 100.0);
    set("steering/axis", "steer");
    set("steering/wheelbase_mm", 400.0);
  }

  template <typename Value>
  void set(const std::string& key, const Value& value) {
    ros::param::set(node.beside("base/" + key), value);
  }

  void launch() {
    const std::string space = node.beside("");
    base = std::make_unique<NodeProcess>(
        std::vector<std::string>{"__ns:=" + space.substr(0, space.size() - 1), "__name:=base"},
        kStepdriverBase);
  }

  void start() {
    node.start();
    odom = std::make_unique<Recorder<Odometry>>(node.beside("odom"));
    joints = std::make_unique<Recorder<JointState>>(node.beside("joint_states"));
    jogs = std::make_unique<Recorder<Jog>>(node.full("jog"));
    states = std::make_unique<Recorder<AxisStates>>(node.full("axis_states"));
    publisher = ros::NodeHandle().advertise<geometry_msgs::Twist>(node.beside("cmd_vel"), 1);
    launch();
    ASSERT_TRUE(waitUntil([this] {
      return says("Ready") && publisher.getNumSubscribers() == 1 && odom->count() > 0 &&
             jogs->connected();
    }));
  }

  bool says(const std::string& words) { return base->output().find(words) != std::string::npos; }
  std::size_t timesSaid(const std::string& words) {
    const std::string output = base->output();
    std::size_t times = 0;
    for (auto at = output.find(words); at != std::string::npos; at = output.find(words, at + 1)) {
      ++times;
    }
    return times;
  }

  void publish(double linear, double angular) {
    geometry_msgs::Twist message;
    message.linear.x = linear;
    message.angular.z = angular;
    publisher.publish(message);
  }

  /// Repeats a command until a condition is true.
  bool driveUntil(double linear, double angular, const std::function<bool()>& happened) {
    return waitUntil([&] {
      publish(linear, angular);
      return happened();
    });
  }

  Odometry pose() { return odom->messages().back(); }
  bool moving(std::size_t axis) { return states->messages().back().moving.at(axis) != 0; }
  double speed(std::size_t axis) { return joints->messages().back().velocity.at(axis); }
  bool rests() {
    const auto velocities = joints->messages().back().velocity;
    return !moving(0) && !moving(1) &&
           std::all_of(velocities.begin(), velocities.end(), [](double v) { return v == 0.0; });
  }
  bool drives() {
    return driveUntil(0.3, 0.0, [&] { return speed(0) > 0.29 && speed(1) > 0.29; });
  }

  NodeUnderTest node;
  std::unique_ptr<NodeProcess> base;
  ros::Publisher publisher;
  std::unique_ptr<Recorder<Odometry>> odom;
  std::unique_ptr<Recorder<JointState>> joints;
  std::unique_ptr<Recorder<Jog>> jogs;
  std::unique_ptr<Recorder<AxisStates>> states;
};

TEST_F(BaseTest, DrivesNowhereByALatchedCommandThatComesAgainWithANewConnection) {
  node.start();
  joints = std::make_unique<Recorder<JointState>>(node.beside("joint_states"));
  states = std::make_unique<Recorder<AxisStates>>(node.full("axis_states"));
  launch();
  ASSERT_TRUE(waitUntil([this] { return says("Ready"); }));
  publisher = ros::NodeHandle().advertise<geometry_msgs::Twist>(node.beside("cmd_vel"), 1, true);
  publish(0.3, 0.0);
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 0; })) << "its publisher is new";
  ASSERT_TRUE(waitUntil([this] { return says("No cmd_vel for") && rests(); }));
  const std::int64_t pulses = node.pulses();
  cutConnections();
  EXPECT_TRUE(waitUntil([&] { return says(", which latches") || node.pulses() > pulses; }));
  EXPECT_TRUE(says(node.beside("cmd_vel") + ": a message of")) << base->output();
  EXPECT_EQ(node.pulses(), pulses);
  publish(0.3, 0.0);
  EXPECT_TRUE(waitUntil([&] { return node.pulses() > pulses; })) << "a newer one";
}

TEST_F(BaseTest, DrivesNowhereByACommandThatWasLatchedBeforeItsStart) {
  set("cmd_vel_timeout", 60.0);
  node.start();
  publisher = ros::NodeHandle().advertise<geometry_msgs::Twist>(node.beside("cmd_vel"), 1, true);
  publish(0.3, 0.0);
  launch();
  EXPECT_TRUE(waitUntil([this] { return says(", which latches") || node.pulses() > 0; }));
  EXPECT_EQ(timesSaid(node.beside("cmd_vel") + ": a message of"), 1U) << base->output();
  ASSERT_TRUE(waitUntil([this] { return says("Ready"); }));
  EXPECT_EQ(node.pulses(), 0);
  publish(0.3, 0.0);
  EXPECT_TRUE(waitUntil([this] { return node.pulses() > 0; })) << "a newer one";
}

TEST_F(BaseTest, DrivesASquareWhosePoseIsThatOfTheCounts) {
  node.set("simulation/speed", 10.0);
  start();
  for (int side = 0; side < 4; ++side) {
    const auto from = pose().pose.pose.position;
    ASSERT_TRUE(driveUntil(0.3, 0.0, [&] {
      const auto at = pose().pose.pose.position;
      return std::hypot(at.x - from.x, at.y - from.y) > 1.0;
    }));
    ASSERT_TRUE(driveUntil(0.0, 0.0, [&] { return rests(); }));
    const double yaw = yawOf(pose());
    ASSERT_TRUE(
        driveUntil(0.0, 0.5, [&] { return std::remainder(yawOf(pose()) - yaw, 2.0 * kPi) > 1.4; }));
    ASSERT_TRUE(driveUntil(0.0, 0.0, [&] { return rests(); }));
  }
  const auto rig = node.rig();
  ASSERT_EQ(rig.name, (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(rig.violations, (std::vector<std::int64_t>{0, 0}));
  const auto counts = [&](std::size_t wheel) {
    return static_cast<double>(rig.pulses_forward[wheel] - rig.pulses_backward[wheel]) * kWheelStep;
  };
  ASSERT_TRUE(waitUntil([&] {
    return std::abs(joints->messages().back().position[0] - counts(0)) < kWheelStep / 2.0 &&
           std::abs(joints->messages().back().position[1] - counts(1)) < kWheelStep / 2.0;
  }));
  const auto last = joints->messages().back().header.stamp;
  ASSERT_TRUE(odom->waitForLatest([&](const Odometry& m) { return m.header.stamp >= last; }));
  EXPECT_NEAR(std::remainder(yawOf(pose()) - (counts(1) - counts(0)) / kSeparation, 2.0 * kPi), 0.0,
              1e-9);
  // The pose from all the counts that were published, on circles instead of chords. Whole steps:
  // the quotient below needs an angle of 0 or one that is much larger than the rounding.
  const auto travel = [](double from, double to) {
    return static_cast<double>(std::llround(to / kWheelStep) - std::llround(from / kWheelStep)) *
           kWheelStep;
  };
  double x = 0.0;
  double y = 0.0;
  double yaw = 0.0;
  const auto all = joints->messages();
  for (std::size_t i = 1; i < all.size(); ++i) {
    const double left = travel(all[i - 1].position[0], all[i].position[0]);
    const double right = travel(all[i - 1].position[1], all[i].position[1]);
    const double angle = (right - left) / kSeparation;
    const double length = (left + right) / 2.0;
    if (angle == 0.0) {
      x += length * std::cos(yaw);
      y += length * std::sin(yaw);
    } else {
      x += length / angle * (std::sin(yaw + angle) - std::sin(yaw));
      y -= length / angle * (std::cos(yaw + angle) - std::cos(yaw));
    }
    yaw += angle;
  }
  EXPECT_NEAR(pose().pose.pose.position.x, x, 1e-9);
  EXPECT_NEAR(pose().pose.pose.position.y, y, 1e-9);
  EXPECT_GT(yaw, 4.0 * 1.4);
}

TEST_F(BaseTest, SendsAllWheelsInOneMessageWithinTheirLimits) {
  start();
  // The right wheel would need 0.75 m/s, but may do 0.5 m/s: both are scaled.
  ASSERT_TRUE(driveUntil(0.6, 1.0, [&] { return std::abs(speed(1) - 0.5) < 1e-6; }));
  EXPECT_TRUE(driveUntil(0.6, 1.0, [&] {
    const auto twist = pose().twist.twist;
    return std::abs(twist.linear.x - 0.4) < 1e-6 && std::abs(twist.angular.z - 0.4 / 0.6) < 1e-6;
  })) << "the curvature of the command";
  for (const Jog& jog : jogs->messages()) {
    ASSERT_EQ(jog.name, (std::vector<std::string>{"left", "right"}));
    ASSERT_NEAR(jog.velocity.at(0) * 0.75, jog.velocity.at(1) * 0.45, 1e-9) << "on the way too";
  }
  EXPECT_EQ(node.process().output().find("jog:"), std::string::npos) << "no jog was refused";
}

TEST_F(BaseTest, PublishesFramesCovariancesAndTheTransform) {
  set("odom_frame", "world");
  set("base_frame", "car");
  XmlRpc::XmlRpcValue variances;
  for (int i = 0; i < 6; ++i) variances[i] = 0.1 * i;
  set("pose_covariance_diagonal", variances);
  set("twist_covariance_diagonal", variances);
  const Recorder<tf2_msgs::TFMessage> tf(std::string("/tf"));
  start();
  const Odometry now = pose();
  EXPECT_EQ(now.header.frame_id, "world");
  EXPECT_EQ(now.child_frame_id, "car");
  EXPECT_NEAR(now.pose.covariance[35], 0.5, 1e-15);
  EXPECT_NEAR(now.twist.covariance[7], 0.1, 1e-15);
  EXPECT_EQ(now.pose.covariance[1], 0.0);
  EXPECT_TRUE(tf.waitFor([](const tf2_msgs::TFMessage& message) {
    return message.transforms.at(0).header.frame_id == "world" &&
           message.transforms[0].child_frame_id == "car" &&
           message.transforms[0].transform.rotation.w == 1.0;
  }));
}

TEST_F(BaseTest, PublishesNoTransformIfItShouldNot) {
  set("publish_tf", false);
  const Recorder<tf2_msgs::TFMessage> tf(std::string("/tf"));
  start();
  ASSERT_TRUE(waitUntil([&] { return odom->count() > 20; }));
  EXPECT_EQ(tf.count(), 0U);
}

TEST_F(BaseTest, ComesToRestWhenTheCommandsEnd) {
  node.set("jog_timeout", 60.0);
  set("cmd_vel_timeout", 0.3);
  start();
  ASSERT_TRUE(drives());
  EXPECT_TRUE(waitUntil([&] { return rests(); }));
  EXPECT_TRUE(says("No cmd_vel for 0.3 s, so the base comes to rest"));
  ASSERT_TRUE(drives()) << "it needs no pause";
}

TEST_F(BaseTest, StopsAllWheelsIfOneHasAFault) {
  node.set("simulation/axes/right/fail_step_write_after", 2000);
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics(std::string("/diagnostics"));
  start();
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return says("All wheels stop: right: "); }));
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return rests(); })) << "the commands continue";
  EXPECT_TRUE(diagnostics.waitFor([](const diagnostic_msgs::DiagnosticArray& message) {
    for (const auto& status : message.status) {
      if (status.name.find("/base: wheels") != std::string::npos &&
          status.level == diagnostic_msgs::DiagnosticStatus::ERROR) {
        return status.message.find("stopped: right: ") == 0;
      }
    }
    return false;
  }));
}

TEST_F(BaseTest, StopsIfAWheelIsDisabledAndNeedsAPauseAfterwards) {
  set("cmd_vel_timeout", 5.0);
  start();
  ASSERT_TRUE(drives());
  std_srvs::SetBool::Request request;
  request.data = false;
  EXPECT_TRUE(node.call<std_srvs::SetBool>("left/enable", request).success);
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return rests() && says("left: disabled; call "); }));
  request.data = true;
  EXPECT_TRUE(node.call<std_srvs::SetBool>("left/enable", request).success);
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return says("when it has paused for 5 s or sent 0"); }));
  const std::size_t before = odom->count();
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return odom->count() > before + 50; }));
  EXPECT_TRUE(rests()) << "a second later";
  publish(0.0, 0.0);
  EXPECT_TRUE(waitUntil([&] { return says("Takes cmd_vel again"); }));
  EXPECT_TRUE(drives());
}

TEST_F(BaseTest, StopsIfSomeoneStopsOneWheel) {
  start();
  ASSERT_TRUE(drives());
  EXPECT_TRUE(node.call<std_srvs::Trigger>("left/stop").success);
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] {
    return rests() && says("All wheels stop: left: it stands although it should turn");
  }));
}

TEST_F(BaseTest, StopsOnHoldAndDrivesAfterResume) {
  start();
  ASSERT_TRUE(drives());
  EXPECT_TRUE(node.call<std_srvs::Trigger>("hold").success);
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return rests() && says("on hold; call "); }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("resume").success);
  publish(0.0, 0.0);
  EXPECT_TRUE(waitUntil([&] { return says("Takes cmd_vel again"); }));
  EXPECT_TRUE(drives());
}

TEST_F(BaseTest, SaysThatTheDriverIsGoneAndContinuesFromItsPose) {
  start();
  ASSERT_TRUE(drives());
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  EXPECT_TRUE(waitUntil([&] {
    return says("All wheels stop: there was no state of " + node.name() + " for 0.5 s");
  }));
  const double x = pose().pose.pose.position.x;
  EXPECT_GT(x, 0.0);
  const std::size_t before = odom->count();
  node.start();
  ASSERT_TRUE(waitUntil([&] { return odom->count() > before && says("has started again"); }));
  EXPECT_NEAR(pose().pose.pose.position.x, x, 1e-9) << "though its counts began at 0";
  EXPECT_TRUE(waitUntil([&] { return says("Takes cmd_vel again"); }));
  EXPECT_TRUE(drives());
}

TEST_F(BaseTest, IgnoresNumbersThatAreNotFiniteAndSaysItOnce) {
  set("cmd_vel_timeout", 3.0);
  start();
  ASSERT_TRUE(drives());
  const double bad = std::numeric_limits<double>::quiet_NaN();
  const std::size_t before = jogs->count();
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
  ASSERT_TRUE(driveUntil(bad, 0.0, [&] { return std::chrono::steady_clock::now() > until; }));
  for (std::size_t i = before; i < jogs->count(); ++i) {
    EXPECT_NEAR(jogs->messages()[i].velocity.at(0), 0.3, 1e-9) << "the last command counts";
  }
  EXPECT_TRUE(driveUntil(0.0, std::numeric_limits<double>::infinity(), [&] { return rests(); }))
      << "they don't count for the timeout";
  EXPECT_EQ(timesSaid("must be a finite number"), 1U);
}

TEST_F(BaseTest, EndsTheJogsWhenItEnds) {
  node.set("jog_timeout", 60.0);
  set("cmd_vel_timeout", 60.0);
  start();
  ASSERT_TRUE(drives());
  base->signal(SIGTERM);
  EXPECT_EQ(base->waitForExit(kBound).value_or(-1), 0);
  EXPECT_TRUE(waitUntil([&] { return rests(); }));
}

TEST_F(BaseTest, SteersATricycle) {
  makeTricycle();
  start();
  ASSERT_TRUE(driveUntil(0.2, 0.5,
                         [&] {
                           return std::abs(pose().twist.twist.linear.x - 0.2) < 1e-3 &&
                                  std::abs(pose().twist.twist.angular.z - 0.5) < 1e-3 &&
                                  speed(1) == 0.0;
                         }))
      << pose().twist.twist.linear.x << " m/s, " << pose().twist.twist.angular.z << " rad/s";
  const auto angle = joints->messages().back().position.at(1);
  EXPECT_NEAR(angle, kPi / 4.0, 2.0 * kPi / 3200.0) << "atan(0.5 rad/s * 0.4 m / 0.2 m/s)";
  ASSERT_TRUE(driveUntil(0.0, 0.0, [&] { return rests(); }));
  EXPECT_NEAR(joints->messages().back().position.at(1), kPi / 4.0, 2.0 * kPi / 3200.0);
}

TEST_F(BaseTest, StopsIfTheSteeringIsRefused) {
  makeTricycle();
  node.set("axes/steer/endstops/max/pin", "steer_max");
  node.set("axes/steer/endstops/max/active_level", "high");
  node.set("simulation/axes/steer/max_switch_deg", -1.0);
  start();
  EXPECT_TRUE(driveUntil(0.2, 0.5, [&] { return says("All wheels stop: steer: "); }));
  EXPECT_TRUE(driveUntil(0.2, 0.5, [&] { return rests(); }));
}

TEST_F(BaseTest, DoesNotStartWithParametersThatAreWrong) {
  set("separation_mm", -1.0);
  set("wheels/left/diameter", 5.0);
  set("driver", "my node");
  launch();
  EXPECT_EQ(base->waitForExit(kBound).value_or(-1), 1);
  expectSays(base->output(), "Not started: 3 errors in the parameters");
  expectSays(base->output(), node.beside("base/separation_mm") + " is -1.0, but must be above 0");
  expectSays(base->output(), "did you mean diameter_mm?");
  expectSays(base->output(), "is \"my node\", but must be the name of a node");
  base.reset();
}

TEST_F(BaseTest, DoesNotStartWithoutTheParametersOfTheDriver) {
  set("driver", "other");
  launch();
  EXPECT_EQ(base->waitForExit(kBound).value_or(-1), 1);
  expectSays(base->output(), node.beside("other/axes") + " isn't on the master");
  base.reset();
}

TEST_F(BaseTest, HasTheLimitsOfTheRobotDescription) {
  node.describe(R"(<robot name="car"><link name="base"/><link name="l"/><link name="r"/>
    <joint name="left" type="prismatic"><parent link="base"/><child link="l"/>
      <limit lower="-1000" upper="1000" effort="1" velocity="0.1"/></joint>
    <joint name="right" type="prismatic"><parent link="base"/><child link="r"/>
      <limit lower="-1000" upper="1000" effort="1" velocity="0.4"/></joint></robot>)");
  start();
  EXPECT_TRUE(driveUntil(0.3, 0.0, [&] { return std::abs(speed(1) - 0.1) < 1e-6; }));
  EXPECT_NEAR(speed(0), 0.1, 1e-6);
}

TEST(BaseByHand, HelpExplainsAndUnknownArgumentsAreRefused) {
  NodeProcess help({"--help"}, kStepdriverBase);
  EXPECT_EQ(help.waitForExit(kBound).value_or(-1), 0);
  expectSays(help.output(), "usage: stepdriver_base");
  NodeProcess unknown({"--hlep"}, kStepdriverBase);
  EXPECT_EQ(unknown.waitForExit(kBound).value_or(0), 64);
}

}  // namespace
}  // namespace stepdriver::node_test
