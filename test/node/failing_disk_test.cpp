#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/SetPosition.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <ostream>
#include <string>

#include "support/fault_injection.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_folder.h"
#include "support/wait.h"

// A disk that fails, or that the kernel has made read-only, under the state file.

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

struct DiskFault {
  const char* name;
  std::atomic<int> InjectedFaults::*which;
  int error;
  const char* file;  // after the path of the state file
  const char* message;
};
void PrintTo(const DiskFault& fault, std::ostream* out) { *out << fault.name; }  // NOLINT: its name

class FailingDisk : public testing::TestWithParam<DiskFault> {
 protected:
  void SetUp() override {
    faults_.concern(folder_.path());
    node_.set("state_file", file());
    node_.set("axes/x/holds_position_unpowered", true);
  }

  std::string file() const { return folder_.path() + "/state"; }
  void setFault(int error) const { faults_.all().*GetParam().which = error; }
  void standAt(double position) {
    EXPECT_TRUE(node_.call<SetPosition>("x/set_position").success);
    EXPECT_TRUE(node_.moveTo(position, true).success);
  }
  bool reports(const Recorder<DiagnosticArray>& diagnostics, int level, const std::string& text) {
    return diagnostics.waitForLatest([&](const DiagnosticArray& array) {
      for (const DiagnosticStatus& status : array.status) {
        if (status.name != node_.name().substr(1) + ": state file") continue;
        return status.level == level && status.message == text;
      }
      return false;
    });
  }
  AxisStates first() {
    const Recorder<AxisStates> states(node_.full("axis_states"));
    EXPECT_TRUE(states.waitFor([](const AxisStates&) { return true; }));
    return states.messages().at(0);
  }

  const test::TemporaryFolder folder_;
  const FaultInjection faults_;
  NodeUnderTest node_;
};

TEST_P(FailingDisk, IsReportedUntilItWorksAgainAndHoldsUpNoMove) {
  const DiskFault& fault = GetParam();
  const std::string why = "the state file " + file() + fault.file + " " + fault.message;
  node_.start();
  const Recorder<DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(reports(diagnostics, DiagnosticStatus::OK, "written"));
  setFault(fault.error);
  standAt(0.008);
  EXPECT_TRUE(reports(diagnostics, DiagnosticStatus::ERROR, why));
  setFault(0);
  EXPECT_TRUE(reports(diagnostics, DiagnosticStatus::OK, "written"));

  setFault(fault.error);
  EXPECT_TRUE(node_.moveTo(0.012, true).success);
  node_.process().signal(SIGTERM);
  EXPECT_EQ(node_.process().waitForExit(kBound).value_or(-1), 4);
  expectSays(node_.process().output(), why + "; the next start may not know the positions");
  // Whatever is on the disk, it isn't trusted.
  setFault(0);
  node_.start();
  const AxisStates after = first();
  EXPECT_FALSE(after.position_valid.at(0)) << after.position.at(0);
}

TEST_P(FailingDisk, AtTheStartIsAReasonNotToStart) {
  const DiskFault& fault = GetParam();
  setFault(fault.error);
  NodeProcess& process = node_.launch();
  EXPECT_EQ(process.waitForExit(kBound).value_or(-1), 1);
  expectSays(process.output(), fault.message);
}

INSTANTIATE_TEST_SUITE_P(
    With, FailingDisk,
    testing::Values(DiskFault{"AReadOnlyFileSystem", &InjectedFaults::open_error, EROFS, ".new",
                              "can't be written: Read-only file system"},
                    DiskFault{"AWriteError", &InjectedFaults::write_error, EIO, ".new",
                              "can't be written: Input/output error"},
                    DiskFault{"ASyncError", &InjectedFaults::sync_error, EIO, ".new",
                              "can't be written: Input/output error"},
                    DiskFault{"ARenameError", &InjectedFaults::rename_error, EIO, "",
                              "can't be replaced: Input/output error"}),
    [](const auto& value) { return std::string(value.param.name); });

class UnreadableDisk : public FailingDisk {};

TEST_P(UnreadableDisk, DoesNotStopTheStartAndThePositionIsNotTrusted) {
  const DiskFault& fault = GetParam();
  node_.start();
  standAt(0.008);
  node_.process().signal(SIGTERM);
  ASSERT_EQ(node_.process().waitForExit(kBound).value_or(-1), 0);
  setFault(fault.error);
  node_.start();
  const AxisStates after = first();
  EXPECT_FALSE(after.position_valid.at(0));
  EXPECT_DOUBLE_EQ(after.position.at(0), 0.0);
  EXPECT_EQ(after.position_note.at(0), "the state file " + file() + " " + fault.message);
  EXPECT_TRUE(node_.moveTo(0.002, true).success);
}

INSTANTIATE_TEST_SUITE_P(With, UnreadableDisk,
                         testing::Values(DiskFault{"AReadError", &InjectedFaults::read_error, EIO,
                                                   "", "can't be read: Input/output error"}),
                         [](const auto& value) { return std::string(value.param.name); });

}  // namespace
}  // namespace stepdriver::node_test
