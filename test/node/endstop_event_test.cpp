#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisState.h>
#include <stepdriver/AxisStates.h>

#include <string>

#include "support/contents_of.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_folder.h"
#include "support/wait.h"

// A motion that nobody waits for meets an endstop.

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

const std::string kMet = "the max endstop was met at ";

bool warnsOfTheEnd(const DiagnosticArray& array) {
  for (const DiagnosticStatus& status : array.status) {
    if (status.message.find("its last motion ended early: " + kMet) == std::string::npos) continue;
    return status.level == DiagnosticStatus::WARN;
  }
  return false;
}

TEST(EndstopEvent, IsInStateLogDiagnosticsAndRecorder) {
  NodeUnderTest node;
  const test::TemporaryFolder folder;
  node.set("simulation/speed", 1.0);
  node.set("recorder/folder", folder.path());
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const Recorder<AxisState> state(node.full("x/state"));
  const Recorder<DiagnosticArray> diagnostics("/diagnostics");
  ASSERT_TRUE(node.moveTo(0.15, false, 0.005).success);
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& all) { return all.moving.at(0) != 0; }));
  std_srvs::SetBool::Request press;
  press.data = 1;
  EXPECT_TRUE(node.call<std_srvs::SetBool>("rig/x/press_max", press).success);

  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& all) { return all.stopped_by.at(0).rfind(kMet, 0) == 0; }));
  EXPECT_TRUE(
      state.waitForLatest([](const AxisState& own) { return own.stopped_by.rfind(kMet, 0) == 0; }));
  EXPECT_TRUE(waitUntil([&] {
    return node.process().output().find("x: its motion has ended: " + kMet) != std::string::npos;
  })) << node.process().output();
  EXPECT_TRUE(diagnostics.waitForLatest(warnsOfTheEnd));
  const auto dump = node.call<std_srvs::Trigger>("dump");
  ASSERT_TRUE(dump.success) << dump.message;
  expectSays(test::contentsOf(dump.message.substr(dump.message.find(" and ") + 5)),
             "met the max endstop at count");

  ASSERT_TRUE(node.moveTo(0.0, true).success);
  EXPECT_TRUE(
      states.waitForLatest([](const AxisStates& all) { return all.stopped_by.at(0).empty(); }));
}

}  // namespace
}  // namespace stepdriver::node_test
