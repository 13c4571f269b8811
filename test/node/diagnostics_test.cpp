#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/SetPosition.h>
#include <unistd.h>

#include <array>
#include <set>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

class DiagnosticsTest : public testing::Test {
 protected:
  /// The node's name without its slash, as in diagnostics.
  std::string nameOf(const std::string& what) const { return node.name().substr(1) + ": " + what; }

  /// Waits until the newest status of this name has this level and begins with this text.
  bool waitFor(const std::string& what, int level, const std::string& words) {
    const bool came = diagnostics.waitForLatest([&](const DiagnosticArray& array) {
      for (const DiagnosticStatus& status : array.status) {
        if (status.name != nameOf(what)) continue;
        last = status;
        return status.level == level && status.message.rfind(words, 0) == 0;
      }
      return false;
    });
    EXPECT_TRUE(came) << "the last is " << static_cast<int>(last.level) << ": " << last.message;
    return came;
  }
  std::string valueOf(const std::string& key) const {
    for (const auto& value : last.values) {
      if (value.key == key) return value.value;
    }
    return "there is no " + key;
  }
  void declareAt(double position) {
    SetPosition::Request request;
    request.position = position;
    EXPECT_TRUE(node.call<SetPosition>("x/set_position", request).success);
  }

  NodeUnderTest node;
  Recorder<DiagnosticArray> diagnostics{"/diagnostics"};
  DiagnosticStatus last;
};

TEST_F(DiagnosticsTest, HaveATaskForEachAxisAndForWhatAllShare) {
  addSecondAxis(node);
  node.start();
  // At first the updater reports each task alone, with the message that the node is starting.
  ASSERT_TRUE(diagnostics.waitForLatest(
      [](const DiagnosticArray& array) { return array.status.size() == 5; }));
  const DiagnosticArray array = diagnostics.messages().back();
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  std::set<std::string> names;
  for (const DiagnosticStatus& status : array.status) {
    names.insert(status.name);
    EXPECT_EQ(status.hardware_id,
              std::string(host.data()) + ": x A4988, y A4988, on the simulated rig");
  }
  EXPECT_EQ(names, (std::set<std::string>{nameOf("x"), nameOf("y"), nameOf("pulse engine"),
                                          nameOf("ROS master"), nameOf("flight recorder")}));
}

TEST_F(DiagnosticsTest, ComeOnceASecond) {
  node.start();
  std::vector<ros::Time> times;
  ASSERT_TRUE(waitUntil([&] {
    times.clear();
    for (const DiagnosticArray& array : diagnostics.messages()) {
      if (array.status.size() == 4) times.push_back(array.header.stamp);
    }
    return times.size() >= 4;
  }));
  // Late edges come closer to the next ones.
  EXPECT_GT((times[3] - times[0]).toSec(), 2.0);
}

TEST_F(DiagnosticsTest, TellTheHardwareIdThatIsConfigured) {
  node.set("hardware_id", "printer 7");
  node.start();
  EXPECT_TRUE(diagnostics.waitFor(
      [](const DiagnosticArray& array) { return array.status.at(0).hardware_id == "printer 7"; }));
}

TEST_F(DiagnosticsTest, DoNotTakeAHardwareIdThatIsNoText) {
  node.set("hardware_id", 7);
  EXPECT_EQ(node.launch().waitForExit(kBound), 1);
  expectSays(node.process().output(), "hardware_id is 7 (an integer), but must be a string");
}

TEST_F(DiagnosticsTest, WarnOfAnAxisUntilItsPositionIsKnownAndFarFromEachLimit) {
  node.start();
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::WARN, "the position is unverified"));
  declareAt(0.0);
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::WARN, "near the soft limit min_position, 0 m"));
  declareAt(0.1);
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::OK, "at rest"));
  EXPECT_EQ(valueOf("position [m]"), "0.1");
  EXPECT_EQ(valueOf("position valid"), "True");
}

TEST_F(DiagnosticsTest, WarnOfAnActiveEndstopWhileItIs) {
  node.set("simulation/axes/x/max_switch_mm", 50.0);
  node.start();
  declareAt(0.0);
  EXPECT_FALSE(node.moveTo(0.1, true, 0.01).success);
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::WARN,
                      "its last motion ended early: the max endstop was met at 0.05 m; the max "
                      "endstop is active"));
  EXPECT_EQ(valueOf("max endstop"), "active");
  EXPECT_TRUE(node.moveTo(0.03, true).success);
  declareAt(0.03);
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::OK, "at rest"));
}

TEST_F(DiagnosticsTest, TellAFaultAndItsRemedyUntilItIsOver) {
  node.start();
  declareAt(0.1);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("emergency_stop").success);
  EXPECT_TRUE(
      waitFor("x", DiagnosticStatus::ERROR, "emergency stop: call recover when all is safe"));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  EXPECT_TRUE(waitFor("x", DiagnosticStatus::OK, "at rest"));
}

TEST_F(DiagnosticsTest, CountWhatThePulseEngineDoes) {
  node.start();
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  EXPECT_TRUE(waitUntil([this] {
    return waitFor("pulse engine", DiagnosticStatus::OK, "pulses in time") &&
           valueOf("edges") == "1600";
  }));
  EXPECT_EQ(valueOf("pulses since the start"), "800");
  EXPECT_EQ(valueOf("slips"), "0");
  EXPECT_EQ(valueOf("lateness since the start max [us]"), "0");
  expectSays(valueOf("margin"), "not measured");
}

}  // namespace
}  // namespace stepdriver::node_test
