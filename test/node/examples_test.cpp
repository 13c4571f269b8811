#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <sensor_msgs/Joy.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/IoStates.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/Plan.h>
#include <stepdriver/RigReport.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/constants.h"
#include "support/program.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/wait.h"

// Each example does what the system does that it replaces.

namespace stepdriver::node_test {
namespace {

using test::kPi;
using Counts = std::vector<std::int64_t>;

MoveTo::Response moveBy(const std::string& axis, double distance, bool wait = true) {
  MoveTo::Request request;
  request.position = distance;
  request.relative = true;
  request.wait = wait;
  return callWhenThere<MoveTo>(axis + "/move_to", request);
}

MoveRounds::Response turn(const std::string& axis, double rounds) {
  MoveRounds::Request request;
  request.rounds = rounds;
  request.wait = true;
  return callWhenThere<MoveRounds>(axis + "/move_rounds", request);
}

Plan::Response planBy(const std::string& axis, double distance) {
  Plan::Request request;
  request.position = distance;
  request.relative = true;
  return callWhenThere<Plan>(axis + "/plan", request);
}

RigReport::Response rigOf(const std::string& node) {
  auto report = callWhenThere<RigReport>(node + "/rig/report");
  for (std::size_t i = 0; i < report.name.size(); ++i) {
    EXPECT_EQ(report.violations[i], 0) << report.name[i] << ": " << report.violation_kinds[i];
  }
  return report;
}

void enable(const std::string& axis) {
  std_srvs::SetBool::Request on;
  on.data = true;
  const auto answer = callWhenThere<std_srvs::SetBool>(axis + "/enable", on);
  EXPECT_TRUE(answer.success) << answer.message;
}

// Distances and revolutions in steps, a ramp between two speeds, and switches that block only their
// own direction. The rig's max switch is at 60 mm.
TEST(Examples, ArduinoCarriageMovesBetweenItsSwitches) {
  const std::string node = "/arduino/stepdriver";
  const std::string x = node + "/x";
  enable(x);
  const auto plan = planBy(x, 0.05);
  ASSERT_EQ(plan.pieces.size(), 3U) << plan.message;
  EXPECT_NEAR(plan.pieces[0].velocity, 0.005, 1e-9) << "the minimum speed";
  EXPECT_NEAR(plan.pieces[0].acceleration, 0.5, 1e-9);
  EXPECT_NEAR(plan.pieces[1].velocity, 0.1, 1e-9);
  EXPECT_TRUE(moveBy(x, 0.05).success);
  EXPECT_EQ(rigOf(node).pulses_forward, Counts{8000});
  EXPECT_TRUE(turn(x, -0.5).success);
  EXPECT_EQ(rigOf(node).pulses_backward, Counts{3200});

  const auto met = moveBy(x, 0.1);
  EXPECT_FALSE(met.success);
  expectSays(met.message, "max endstop");
  EXPECT_NEAR(met.position, 0.06, 1.5 / 160000.0) << "not one step more";
  const auto blocked = moveBy(x, 0.001);
  EXPECT_FALSE(blocked.success);
  expectSays(blocked.message, "only towards min");
  EXPECT_TRUE(moveBy(x, -0.01).success) << "the other way is free";

  Microstep::Request coarse;
  coarse.microsteps = 8;
  const auto changed = callWhenThere<Microstep>(x + "/microstep", coarse);
  EXPECT_TRUE(changed.success) << changed.message;
}

// Each stick turns its own motor, both at once, faster if it is tilted farther; in the middle the
// motor is off.
TEST(Examples, Esp32SticksTurnTwoMotorsAtTheSameTime) {
  const std::string node = "/esp32/stepdriver";
  const Recorder<AxisStates> states(node + "/axis_states");
  auto joy = ros::NodeHandle().advertise<sensor_msgs::Joy>("/esp32/joy", 1);
  const auto hold = [&joy](float left, float right, const auto& until) {
    sensor_msgs::Joy sticks;
    sticks.axes = {left, right};
    return waitUntil([&] {
      joy.publish(sticks);
      return until();
    });
  };
  const auto latest = [&states](const auto& wanted) {
    return [&states, wanted] {
      const std::vector<AxisStates> all = states.messages();
      return !all.empty() && wanted(all.back());
    };
  };
  const double half = 4.0 * kPi * (0.55 - 0.1) / 0.9;
  EXPECT_TRUE(hold(0.55F, -1.0F, latest([half](const AxisStates& s) {
                     return std::abs(s.velocity.at(0) - half) < 0.01 &&
                            std::abs(s.velocity.at(1) + 4.0 * kPi) < 0.01;
                   })))
      << "half speed forward, full speed backward";
  EXPECT_TRUE(hold(0.05F, -0.05F, latest([](const AxisStates& s) {
                     return s.moving.at(0) == 0 && s.moving.at(1) == 0 && s.enabled.at(0) == 0 &&
                            s.enabled.at(1) == 0;
                   })))
      << "at rest and off in the dead band";
  const auto report = rigOf(node);
  EXPECT_GT(report.pulses_forward.at(0), 0);
  EXPECT_EQ(report.pulses_backward.at(0), 0);
  EXPECT_EQ(report.pulses_forward.at(1), 0);
  EXPECT_GT(report.pulses_backward.at(1), 0);
}

// 1600 pulses per revolution, a short move that is just as exact, and 20,000 pulses/s.
TEST(Examples, NanoMotorTurnsExactly) {
  const std::string node = "/nano/stepdriver";
  const std::string motor = node + "/motor";
  EXPECT_TRUE(turn(motor, 1.0).success);
  EXPECT_EQ(rigOf(node).pulses_forward, Counts{1600});
  EXPECT_TRUE(turn(motor, 7.0 / 1600.0).success);
  EXPECT_EQ(rigOf(node).pulses_forward, Counts{1607});
  const auto fast = turn(motor, -10.0);
  EXPECT_TRUE(fast.success) << fast.message;
  // 12.5 revolutions/s and 25 revolutions/s^2: the distance at full speed, and half of it for the
  // ramps.
  EXPECT_NEAR(fast.duration, 10.0 / 12.5 + 12.5 / 25.0, 1e-3);
  EXPECT_EQ(rigOf(node).pulses_backward, Counts{16000});
}

// Straight lines of both knobs together, drawn from the pulses; the drivers sleep while nothing
// moves.
TEST(Examples, PsocSketchDrawsAndThenSleeps) {
  const std::string node = "/psoc/stepdriver";
  const Recorder<AxisStates> states(node + "/axis_states");
  const TemporaryFile points(".txt");
  const TemporaryFile picture(".png");
  std::ofstream(points.path()) << "0 0\n30 10\n10 30\n0 0\n";
  const auto end =
      runProgram("draw", {points.path(), "--node", node, "-o", picture.path(), "--tolerance", "0"});
  EXPECT_EQ(end.code, 0);
  expectSays(end.output, "92 of 92 mm, 100 %");
  EXPECT_TRUE(picture.exists());
  const auto report = rigOf(node);
  EXPECT_EQ(report.pulses_forward, (Counts{600, 600}));
  EXPECT_EQ(report.pulses_backward, (Counts{600, 600}));
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return s.idle.at(0) != 0 && s.idle.at(1) != 0; }));
  EXPECT_TRUE(moveBy(node + "/x", 0.01).success) << "it wakes by itself";
  EXPECT_EQ(rigOf(node).pulses_forward, (Counts{800, 600}));
}

// The pen is on for each stroke, and not between them.
TEST(Examples, PsocSketchLiftsItsPen) {
  const std::string node = "/psoc/stepdriver";
  const Recorder<IoStates> outputs(node + "/io_states");
  const TemporaryFile points(".txt");
  const TemporaryFile picture(".png");
  std::ofstream(points.path()) << "0 0\n10 0\n\n20 0\n30 0\n";
  ASSERT_TRUE(outputs.waitForLatest([](const IoStates& io) { return io.output_on.at(0) == 0; }));
  const auto end =
      runProgram("draw", {points.path(), "--node", node, "-o", picture.path(), "--pen", "pen"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_TRUE(outputs.waitForLatest([](const IoStates& io) { return io.output_on.at(0) == 0; }));
  std::vector<ros::Time> lowered;
  for (const IoStates& io : outputs.messages()) {
    const bool is_new = lowered.empty() || io.output_changed.at(0) != lowered.back();
    if (io.output_on.at(0) != 0 && is_new) lowered.push_back(io.output_changed.at(0));
  }
  EXPECT_EQ(lowered.size(), 2U);
}

// Wired common-anode, with its own deceleration; 20 revolutions, a single step, and a new move at
// any time.
TEST(Examples, Stm32WheelRollsTwentyTurns) {
  const std::string node = "/stm32/stepdriver";
  const std::string x = node + "/x";
  const auto plan = planBy(x, 20.0 * 0.1 * kPi);
  ASSERT_EQ(plan.pieces.size(), 3U) << plan.message;
  EXPECT_NEAR(plan.pieces[0].acceleration, 0.5, 1e-9);
  EXPECT_NEAR(plan.pieces[2].acceleration, -1.5, 1e-9);
  const auto rolled = moveBy(x, 20.0 * 0.1 * kPi);
  EXPECT_TRUE(rolled.success) << rolled.message;
  EXPECT_EQ(rigOf(node).pulses_forward, Counts{32000});
  EXPECT_TRUE(moveBy(x, 0.00019635).success);
  EXPECT_EQ(rigOf(node).pulses_forward, Counts{32001}) << "a single step";
  const auto again = moveBy(x, 20.0 * 0.1 * kPi);
  EXPECT_TRUE(again.success) << "there is no end: " << again.message;
  EXPECT_TRUE(moveBy(x, -3.0, false).success);
  MoveTo::Request home;
  home.wait = true;
  const auto back = callWhenThere<MoveTo>(x + "/move_to", home);
  EXPECT_TRUE(back.success) << back.message;
  EXPECT_NEAR(back.position, 0.0, 1e-4);
  const auto report = rigOf(node);
  EXPECT_EQ(report.pulses_forward.at(0), report.pulses_backward.at(0));
}

// Two such wheels, and the message of teleop_twist_keyboard's key "u": forwards and to the left.
TEST(Examples, Stm32CarDrivesByTheMessagesOfAKeyboard) {
  const std::string node = "/car/stepdriver";
  const Recorder<nav_msgs::Odometry> odom(std::string("/car/odom"));
  // A key that is held before the base is ready counts only after a pause.
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics(std::string("/diagnostics"));
  ASSERT_TRUE(diagnostics.waitFor([](const diagnostic_msgs::DiagnosticArray& message) {
    return std::any_of(message.status.begin(), message.status.end(), [](const auto& status) {
      return status.name.find("/base: wheels") != std::string::npos &&
             status.message == "takes cmd_vel";
    });
  }));
  auto keyboard = ros::NodeHandle().advertise<geometry_msgs::Twist>("/car/cmd_vel", 1);
  geometry_msgs::Twist key;
  key.linear.x = 0.5;
  key.angular.z = 1.0;
  EXPECT_TRUE(waitUntil([&] {
    keyboard.publish(key);
    if (odom.count() == 0) return false;
    const auto twist = odom.messages().back().twist.twist;
    return std::abs(twist.linear.x - 0.5) < 1e-6 && std::abs(twist.angular.z - 1.0) < 1e-6;
  }));
  keyboard.publish(geometry_msgs::Twist());  // its key "k"
  EXPECT_TRUE(odom.waitForLatest([](const nav_msgs::Odometry& message) {
    return message.twist.twist.linear.x == 0.0 && message.twist.twist.angular.z == 0.0;
  }));
  const auto report = rigOf(node);
  ASSERT_EQ(report.name, (std::vector<std::string>{"left", "right"}));
  EXPECT_GT(report.pulses_forward.at(0), 0) << "plus is forwards on both sides";
  EXPECT_GT(report.pulses_forward.at(1), report.pulses_forward.at(0));
  EXPECT_EQ(report.violations, (Counts{0, 0}));
}

}  // namespace
}  // namespace stepdriver::node_test
