#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "support/contents_of.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_folder.h"
#include "support/vcd_reader.h"
#include "support/wait.h"

// Tests the recordings of the node: what its lines and clients did last.

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;
using std_srvs::Trigger;
using test::contentsOf;

class FlightRecorder : public testing::Test {
 protected:
  void SetUp() override {
    node_.set("recorder/folder", folder_);
    node_.set("recorder/seconds",
              600.0);  // 30 s of the wall clock, as the rig runs 20 times as fast
  }

  std::vector<std::string> filesThatEndWith(const std::string& end) const {
    std::vector<std::string> paths;
    std::error_code none_yet;
    for (const auto& entry : std::filesystem::directory_iterator(folder_, none_yet)) {
      if (entry.path().extension() == end) paths.push_back(entry.path().string());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
  }
  // The text is written after the trace: then the recording is complete.
  std::string awaitRecording(const std::string& reason) const {
    std::string text;
    const auto there = [&] {
      for (const std::string& path : filesThatEndWith(".txt")) {
        text = contentsOf(path);
        if (text.find("reason:  " + reason + "\n") != std::string::npos &&
            text.find("  recorded\n") != std::string::npos) {
          return true;
        }
      }
      return false;
    };
    EXPECT_TRUE(waitUntil(there)) << "no recording says: " << reason;
    return text;
  }
  static std::vector<std::int64_t> intervalsOf(const Waveform& waveform) {
    std::vector<std::int64_t> intervals;
    for (std::size_t i = 2; i < waveform.edges.size(); ++i) {
      intervals.push_back(waveform.edges[i].time_ns - waveform.edges[i - 1].time_ns);
    }
    return intervals;
  }

  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_.path() + "/of/the node";
  NodeUnderTest node_;
};

TEST_F(FlightRecorder, AnswersADumpWithATraceThatIsTheRigsEdgeForEdge) {
  const std::string rig_trace = node_.traced();
  node_.start();
  EXPECT_TRUE(node_.moveTo(0.003, true).success);
  EXPECT_TRUE(node_.moveTo(0.001, true).success);
  const Trigger::Response dump = node_.call<Trigger>("dump");
  EXPECT_TRUE(dump.success) << dump.message;
  const std::vector<std::string> traces = filesThatEndWith(".vcd");
  const std::vector<std::string> texts = filesThatEndWith(".txt");
  ASSERT_EQ(traces.size(), 1U);
  ASSERT_EQ(texts.size(), 1U);
  EXPECT_EQ(dump.message, traces[0] + " and " + texts[0]);

  node_.rig();  // writes the rig's trace
  auto recorded = readVcd(traces[0]);
  auto seen = readVcd(rig_trace);
  EXPECT_EQ(recorded.at("x/step").changesTo(true), 240 + 160);
  for (const char* pin : {"x/step", "x/dir", "x/enable", "x/ms1", "x/sleep", "x/reset"}) {
    const std::vector<std::int64_t> intervals = intervalsOf(recorded.at(pin));
    EXPECT_EQ(intervals, intervalsOf(seen.at(pin))) << pin;
    EXPECT_EQ(recorded.at(pin).edges.front().level, seen.at(pin).edges.front().level) << pin;
  }
  const std::string events = contentsOf(texts[0]);
  expectSays(events, "reason:  the service dump\n");
  expectSays(events, "move x to 0.003 m");
  expectSays(events, "motor from count 240 (0.003 m) to 80 (0.001 m)");
}

TEST_F(FlightRecorder, WritesOnSigusr1AndTheNodeMovesOn) {
  node_.start();
  EXPECT_TRUE(node_.moveTo(0.001, true).success);
  node_.process().signal(SIGUSR1);
  expectSays(awaitRecording("SIGUSR1"), "move x to 0.001 m");
  EXPECT_TRUE(node_.moveTo(0.002, true).success);
  EXPECT_EQ(node_.pulses(), 160);
}

TEST_F(FlightRecorder, WritesAtAFault) {
  node_.set("simulation/axes/x/fail_step_write_after", 100);
  node_.start();
  EXPECT_FALSE(node_.moveTo(0.01, true).success);
  expectSays(awaitRecording("fault"), "x: fault: the STEP line");
}

TEST_F(FlightRecorder, WritesAtAnEmergencyStop) {
  node_.start();
  EXPECT_TRUE(node_.moveTo(0.2, false, 0.01).success);
  EXPECT_TRUE(node_.call<Trigger>("emergency_stop").success);
  expectSays(awaitRecording("fault"), "was ended by an emergency stop");
}

TEST_F(FlightRecorder, SaysOnceThatItsFilesCannotBeWrittenAndTheAxesMoveOn) {
  std::ofstream(scratch_.path() + "/of") << "a file instead of the folder";
  node_.start();
  const Recorder<DiagnosticArray> diagnostics("/diagnostics");
  const auto comes = [&](int level, const std::string& words) {
    return diagnostics.waitForLatest([&](const DiagnosticArray& array) {
      for (const DiagnosticStatus& status : array.status) {
        if (status.name != node_.name().substr(1) + ": flight recorder") continue;
        return status.level == level && status.message.find(words) != std::string::npos;
      }
      return false;
    });
  };
  EXPECT_TRUE(comes(DiagnosticStatus::OK, "records"));
  const std::string why = "the flight recorder can't write the folder " + folder_;
  for (int i = 1; i <= 3; ++i) {
    const Trigger::Response dump = node_.call<Trigger>("dump");
    EXPECT_FALSE(dump.success);
    expectSays(dump.message, why);
    EXPECT_TRUE(node_.moveTo(0.001 * i, true).success);
  }
  EXPECT_EQ(node_.pulses(), 240);
  EXPECT_TRUE(comes(DiagnosticStatus::WARN, why));
  std::filesystem::remove(scratch_.path() + "/of");
  EXPECT_TRUE(node_.call<Trigger>("dump").success);
  EXPECT_TRUE(comes(DiagnosticStatus::OK, "records"));
  node_.process().signal(SIGTERM);
  EXPECT_EQ(node_.process().waitForExit(kBound).value_or(-1), 0);
  const std::string output = node_.process().output();
  // The calls that are refused are logged too, with other words before it.
  const auto first = output.find("]: " + why);
  ASSERT_NE(first, std::string::npos) << output;
  EXPECT_EQ(output.find("]: " + why, first + 1), std::string::npos) << output;
}

TEST_F(FlightRecorder, IsOffWithoutSeconds) {
  node_.set("recorder/seconds", 0.0);
  node_.start();
  const Trigger::Response dump = node_.call<Trigger>("dump");
  EXPECT_FALSE(dump.success);
  EXPECT_EQ(dump.message, "nothing is recorded: recorder/seconds is 0");
  node_.process().signal(SIGUSR1);
  EXPECT_TRUE(node_.moveTo(0.001, true).success);
  EXPECT_FALSE(std::filesystem::exists(folder_));
}

TEST_F(FlightRecorder, SaysHowManySecondsItsMemoryHolds) {
  node_.set("recorder/memory_mb", 1.0);
  node_.set("recorder/seconds", 60.0);
  node_.start();
  node_.process().signal(SIGTERM);
  ASSERT_TRUE(node_.process().waitForExit(kBound));
  expectSays(node_.process().output(), "the flight recorder keeps 7.8125 s instead of 60 s");
}

}  // namespace
}  // namespace stepdriver::node_test
