#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/IoStates.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/SetOutput.h>
#include <stepdriver/SetOutputValue.h>
#include <stepdriver/SetPosition.h>
#include <stepdriver/SetPositionCompare.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "support/contents_of.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// Outputs and inputs with a name: service, topic, diagnostics and the rig.

namespace stepdriver::node_test {
namespace {

class NamedLines : public testing::Test {
 protected:
  NamedLines() {
    node.set("outputs/pen/pin", "pen");
    node.set("outputs/pen/max_on_s", 3600.0);
    node.set("outputs/relay/pin", "relay");
    node.set("outputs/relay/initial", "on");
    node.set("inputs/probe/pin", "probe");
    node.set("inputs/probe/active_level", "low");
    node.set("inputs/probe/debounce_ms", 5.0);
    node.set("simulation/inputs/probe/bounces", 10);
  }

  SetOutput::Response set(const std::string& name, bool on) {
    SetOutput::Request request;
    request.name = name;
    request.on = on;
    return node.call<SetOutput>("set_output", request);
  }
  void press(bool pressed) {
    std_srvs::SetBool::Request request;
    request.data = pressed;
    EXPECT_TRUE(node.call<std_srvs::SetBool>("rig/inputs/probe", request).success);
  }

  NodeUnderTest node;
};

/// An output of pulses, on the rig a line.
class PwmOutput : public NamedLines {
 protected:
  PwmOutput() {
    node.erase("outputs/pen/pin");
    node.erase("outputs/pen/max_on_s");
    node.set("outputs/pen/servo/chip", 0);
    node.set("outputs/pen/servo/channel", 1);
  }
  SetOutputValue::Response setValue(const std::string& name, double value) {
    SetOutputValue::Request request;
    request.name = name;
    request.value = value;
    return node.call<SetOutputValue>("set_output_value", request);
  }
};

TEST_F(PwmOutput, HasValuesByAServiceAndByATopic) {
  node.start();
  const Recorder<IoStates> states(node.full("io_states"));
  const auto shows = [&](double value) {
    return states.waitForLatest([value](const IoStates& now) {
      return std::abs(now.output_value.at(0) - value) < 1e-4 &&
             (now.output_on.at(0) != 0) == (value > 0.0);
    });
  };
  EXPECT_EQ(setValue("pen", 0.25).message, "pen is at 0.25");
  EXPECT_TRUE(shows(0.25));
  EXPECT_TRUE(set("pen", true).success);
  EXPECT_TRUE(shows(1.0));
  const SetOutputValue::Response refused = setValue("relay", 0.5);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "is one of a PWM output, and this is none");
  EXPECT_FALSE(setValue("pen", 1.5).success);
  ros::Publisher publisher =
      ros::NodeHandle().advertise<std_msgs::Float64>(node.full("outputs/pen"), 1);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1; }));
  std_msgs::Float64 message;
  for (const double value : {0.5, 2.0, 0.75, 0.0}) {
    message.data = value;
    publisher.publish(message);
    if (value <= 1.0) {
      EXPECT_TRUE(shows(value)) << value;
    }
  }
}

TEST_F(PwmOutput, HasItsValueInTheDiagnostics) {
  node.start();
  const Recorder<diagnostic_msgs::DiagnosticArray> reports("/diagnostics");
  const auto shows = [&](const std::string& output, const std::string& words) {
    return reports.waitForLatest([&](const diagnostic_msgs::DiagnosticArray& report) {
      for (const auto& status : report.status) {
        for (const auto& value : status.values) {
          if (value.key == "output " + output) return value.value == words;
        }
      }
      return false;
    });
  };
  EXPECT_TRUE(setValue("pen", 0.4).success);
  EXPECT_TRUE(shows("pen", "on at 0.4"));
  EXPECT_TRUE(set("pen", true).success);
  EXPECT_TRUE(shows("pen", "on"));
  EXPECT_TRUE(setValue("pen", 0.0).success);
  EXPECT_TRUE(shows("pen", "off"));
  EXPECT_TRUE(shows("relay", "on")) << "a plain line";
}

TEST_F(NamedLines, AreSwitchedByAServiceAndShownByALatchedTopic) {
  node.start();
  const SetOutput::Response response = set("pen", true);
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_EQ(response.message, "pen is on");
  const Recorder<IoStates> states(node.full("io_states"));
  ASSERT_TRUE(states.waitForLatest([](const IoStates& now) {
    return now.output_name == std::vector<std::string>{"pen", "relay"} && now.output_on.at(0) &&
           now.output_on.at(1);
  })) << "a late subscriber sees them";
  const IoStates first = states.messages().back();
  EXPECT_GT(first.output_changed.at(0), ros::Time(0));
  EXPECT_LE(first.output_changed.at(0), first.header.stamp);
  EXPECT_EQ(first.input_name, std::vector<std::string>{"probe"});
  EXPECT_FALSE(first.input_active.at(0));
  EXPECT_EQ(first.input_changed.at(0), ros::Time(0));
  const std::size_t before = states.count();
  press(true);
  EXPECT_TRUE(
      states.waitForLatest([](const IoStates& now) { return now.input_active.at(0) != 0; }));
  press(false);
  EXPECT_TRUE(states.waitForLatest([](const IoStates& now) {
    return !now.input_active.at(0) && now.input_changed.at(0) > ros::Time(0);
  }));
  EXPECT_LE(states.count() - before, 2U) << "bounces are no changes";
}

TEST_F(NamedLines, AreSwitchedByThePositionOfAnAxis) {
  node.start();
  const Recorder<IoStates> states(node.full("io_states"));
  SetPosition::Request zero;
  EXPECT_TRUE(node.call<SetPosition>("x/set_position", zero).success);
  SetPositionCompare::Request compare;
  compare.output = "pen";
  compare.axis = "x";
  compare.distance = 0.002;
  compare.begin = 0.002;
  compare.end = 0.02;
  compare.pulse = 0.001;
  const auto answer = node.call<SetPositionCompare>("set_position_compare", compare);
  ASSERT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(answer.message, "the position of x switches pen");
  EXPECT_FALSE(set("pen", true).success);
  MoveTo::Request move;
  move.position = 0.025;
  move.wait = true;
  EXPECT_TRUE(node.call<MoveTo>("x/move_to", move).success);
  EXPECT_TRUE(states.waitForLatest([](const IoStates& now) {
    return now.output_axis == std::vector<std::string>{"x", ""} &&
           now.output_compared.at(0) == 10 && now.output_missed.at(0) == 0;
  }));
  compare.pulse = -1.0;
  EXPECT_EQ(node.call<SetPositionCompare>("set_position_compare", compare).message,
            "pulse is -1 s, but must be 0 to 10 s");
  compare.direction = 2;
  EXPECT_NE(
      node.call<SetPositionCompare>("set_position_compare", compare).message.find("direction"),
      std::string::npos);
  compare.axis.clear();
  EXPECT_TRUE(node.call<SetPositionCompare>("set_position_compare", compare).success);
  EXPECT_TRUE(set("pen", true).success);
}

TEST_F(NamedLines, AreSafeAfterAnEmergencyStopAndRefusedUntilRecover) {
  node.start();
  const Recorder<IoStates> states(node.full("io_states"));
  EXPECT_TRUE(set("pen", true).success);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("emergency_stop").success);
  EXPECT_TRUE(states.waitForLatest(
      [](const IoStates& now) { return !now.output_on.at(0) && !now.output_on.at(1); }));
  const SetOutput::Response refused = set("pen", true);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "the output pen: x is at fault: emergency stop; call recover first");
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  EXPECT_TRUE(set("pen", true).success);
  const SetOutput::Response unknown = set("pan", true);
  EXPECT_FALSE(unknown.success);
  expectSays(unknown.message, "there is no output pan (outputs: pen, relay)");
}

TEST_F(NamedLines, AreInTheDiagnosticsWithTheirErrors) {
  node.set("simulation/outputs/pen/fail_write_after", 1);
  node.start();
  const Recorder<diagnostic_msgs::DiagnosticArray> reports("/diagnostics");
  const auto shows = [&](int level, const std::string& words) {
    return waitUntil([&] {
      for (const auto& report : reports.messages()) {
        for (const auto& status : report.status) {
          const bool is_it = status.name.find("named lines") != std::string::npos &&
                             status.level == level &&
                             status.message.find(words) != std::string::npos;
          if (is_it) return true;
        }
      }
      return false;
    });
  };
  EXPECT_TRUE(shows(diagnostic_msgs::DiagnosticStatus::OK, ""));
  EXPECT_TRUE(set("pen", true).success);
  const SetOutput::Response failed = set("pen", false);
  EXPECT_FALSE(failed.success);
  expectSays(failed.message, "the output pen can't be written: EIO");
  EXPECT_TRUE(shows(diagnostic_msgs::DiagnosticStatus::ERROR, "the output pen can't be written"));
}

TEST_F(NamedLines, AreInTheTraceOfTheRig) {
  const std::string trace = node.traced();
  node.start();
  EXPECT_TRUE(set("pen", true).success);
  press(true);
  node.rig();
  const std::string text = test::contentsOf(trace);
  for (const char* words : {"$scope module outputs", "$scope module inputs", " pen $end",
                            " relay $end", " probe $end"}) {
    expectSays(text, words);
  }
}

TEST(WithoutNamedLines, TheServiceRefusesAndTheTopicIsEmpty) {
  NodeUnderTest node;
  node.start();
  SetOutput::Request request;
  request.name = "pen";
  const SetOutput::Response response = node.call<SetOutput>("set_output", request);
  EXPECT_FALSE(response.success);
  expectSays(response.message, "there is no output pen: none is configured");
  const Recorder<IoStates> states(node.full("io_states"));
  EXPECT_TRUE(states.waitForLatest(
      [](const IoStates& now) { return now.output_name.empty() && now.input_name.empty(); }));
}

}  // namespace
}  // namespace stepdriver::node_test
