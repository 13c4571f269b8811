#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <stepdriver/DriverState.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/SetCurrent.h>
#include <stepdriver/SetStallThreshold.h>

#include <cmath>
#include <regex>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_file.h"

// A driver on a UART: its currents and its state, by service, topic and diagnostics.

namespace stepdriver::node_test {
namespace {

/// x has a driver on a UART.
class NodeWithTmc : public NodeUnderTest {
 public:
  NodeWithTmc() {
    NodeUnderTest& node = *this;
    node.set("axes/x/driver", "tmc2209");
    for (const char* pin : {"ms1", "ms2", "ms3", "sleep", "reset"}) {
      node.erase(std::string("axes/x/pins/") + pin);
    }
    node.set("axes/x/tmc/port", "/dev/serial0");
    node.set("axes/x/tmc/address", 0);
    node.set("axes/x/tmc/sense_resistor_mohm", 110.0);
    node.set("axes/x/tmc/run_current_a", 0.8);
  }

  /// x has a driver on SPI in its place.
  void isOnSpi() {
    set("axes/x/driver", "tmc2130");
    for (const char* key : {"port", "address"}) erase(std::string("axes/x/tmc/") + key);
    set("axes/x/tmc/spi", "/dev/spidev0.0");
    set("axes/x/tmc/mode", "spreadcycle");
  }

  /// So heavy that the most sensitive threshold on SPI is too sensitive.
  void hasHeavyLoad() {
    set("simulation/axes/x/motor/holding_torque_nm", 0.3);
    set("simulation/axes/x/motor/friction_nm", 0.19);
  }

  /// It is homed by its stall, and has no switch.
  void homesToStall(int threshold) {
    erase("axes/x/endstops");
    set("axes/x/tmc/stall_threshold", threshold);
    set("axes/x/homing/kind", "stall");
    set("axes/x/homing/towards", "min");
    set("axes/x/homing/seek_speed_mm_s", 50.0);
    set("axes/x/homing/pull_off_mm", 8.0);
    set("axes/x/homing/max_travel_mm", 250.0);
  }

  ProgramEnd tuneStall(const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"--node", name(), "--axis", "x", "--distance", "150"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return runProgram("tune_stall", arguments);
  }
};

class TmcNode : public testing::Test {
 protected:
  SetCurrent::Response setCurrent(double run, double hold) {
    SetCurrent::Request request;
    request.run_current = run;
    request.hold_current = hold;
    return node.call<SetCurrent>("x/set_current", request);
  }

  NodeWithTmc node;
};

TEST_F(TmcNode, MovesAndChangesItsMicrosteps) {
  node.start();
  EXPECT_TRUE(node.moveTo(0.02, true).success);
  Microstep::Request request;
  request.microsteps = 256;
  EXPECT_TRUE(node.call<Microstep>("x/microstep", request).success);
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  EXPECT_NEAR(node.rig().carriage.at(0), 0.01, 1e-9);
}

TEST_F(TmcNode, ShowsWhatItsDriverSaysAndTakesAnotherCurrent) {
  node.start();
  const Recorder<DriverState> states(node.full("x/driver"));
  ASSERT_TRUE(states.waitForLatest([](const DriverState& state) {
    return state.motor.size() == 1 && state.set_up.at(0) && state.accesses.at(0) > 0 &&
           std::abs(state.run_current.at(0) - 0.795) < 1e-3 && state.retries.at(0) == 0;
  }));
  const SetCurrent::Response refused = setCurrent(0.9, 0.0);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "to 0.8 A, its tmc/run_current_a");
  EXPECT_NEAR(refused.run_current, 0.795, 1e-3);
  const SetCurrent::Response response = setCurrent(0.5, 0.1);
  EXPECT_TRUE(response.success) << response.message;
  expectSays(response.message, "x: 0.4895");
  EXPECT_NEAR(response.run_current, 0.4895, 1e-3);
  EXPECT_TRUE(states.waitForLatest([](const DriverState& state) {
    return std::abs(state.run_current.at(0) - 0.4895) < 1e-3 &&
           std::abs(state.hold_current.at(0) - 0.0918) < 1e-3;
  }));
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(diagnostics.waitForLatest([&](const diagnostic_msgs::DiagnosticArray& array) {
    for (const auto& status : array.status) {
      for (const auto& value : status.values) {
        if (value.key == "run current [A]") return std::abs(std::stod(value.value) - 0.49) < 0.01;
      }
    }
    return false;
  }));
}

// First the load is measured; with the threshold that it leads to, the homings are checked.
TEST_F(TmcNode, ItsStallIsTunedByATool) {
  const TemporaryFile picture(".svg");
  int threshold = 0;
  {
    NodeWithTmc measured;
    measured.set("simulation/speed", 1.0);
    measured.set("simulation/axes/x/motor/friction_nm", 0.02);
    measured.start();
    const ProgramEnd end = measured.tuneStall({"--speed", "50", "-o", picture.path()});
    ASSERT_EQ(end.code, 0) << end.output;
    expectSays(end.output, "forward: SG_RESULT from");
    expectSays(end.output, "back: SG_RESULT from");
    expectSays(picture.text(), "SG_RESULT");
    std::smatch found;
    ASSERT_TRUE(std::regex_search(end.output, found, std::regex("stall_threshold: (\\d+)")));
    threshold = std::stoi(found[1]);
    const SetCurrent::Response current = measured.call<SetCurrent>("x/set_current");
    EXPECT_NEAR(current.run_current, 0.795, 1e-3) << "the current is as before";
  }
  NodeWithTmc homed;
  homed.homesToStall(threshold);
  homed.set("simulation/axes/x/start_mm", 60.0);
  homed.start();
  const ProgramEnd end = homed.tuneStall({"--check", "--homings", "4"});
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "4: MSCNT ");
  expectSays(end.output, "4 homings ended within ");
  expectSays(end.output, "stall_phase: ");
}

// Each of the thresholds is tried by a move in both directions.
TEST_F(TmcNode, ItsStallIsTunedOnSpiToo) {
  const TemporaryFile picture(".svg");
  int threshold = 0;
  {
    NodeWithTmc measured;
    measured.isOnSpi();
    measured.set("simulation/speed", 1.0);
    measured.hasHeavyLoad();
    measured.start();
    const ProgramEnd end =
        measured.tuneStall({"--speed", "50", "--distance", "45", "-o", picture.path()});
    ASSERT_EQ(end.code, 0) << end.output;
    expectSays(end.output, "stall_threshold 63:");
    std::smatch found;
    ASSERT_TRUE(std::regex_search(end.output, found, std::regex("tmc:\n  stall_threshold: (.*)")));
    threshold = std::stoi(found[1]);
    EXPECT_GT(threshold, -64);
    EXPECT_LT(threshold, 63);
    SetStallThreshold::Request refused;
    refused.threshold = 64;
    expectSays(measured.call<SetStallThreshold>("x/set_stall_threshold", refused).message,
               "must be from -64 to 63");
  }
  NodeWithTmc homed;
  homed.isOnSpi();
  homed.homesToStall(threshold);
  homed.hasHeavyLoad();
  homed.set("simulation/axes/x/start_mm", 60.0);
  homed.start();
  const ProgramEnd end = homed.tuneStall({"--check", "--homings", "4"});
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "4 homings ended within ");
}

TEST_F(TmcNode, StallsAreTunedForChipsThatMeasureThemOnly) {
  node.set("axes/x/tmc/mode", "spreadcycle");
  node.start();
  const ProgramEnd end = node.tuneStall({"--speed", "50"});
  EXPECT_EQ(end.code, 1);
  expectSays(end.output, "the chip measures its load with stealthchop only");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(TmcNode, HasNoSuchTopicWithoutTmc) {
  node.erase("axes/x/tmc");
  node.erase("axes/x/microsteps");
  node.set("axes/x/microsteps", 16);
  node.start();
  expectSays(setCurrent(0.5, 0.1).message, "its current is set by the board");
  ros::master::V_TopicInfo topics;
  ASSERT_TRUE(ros::master::getTopics(topics));
  for (const auto& topic : topics) EXPECT_NE(topic.name, node.full("x/driver"));
}

}  // namespace
}  // namespace stepdriver::node_test
