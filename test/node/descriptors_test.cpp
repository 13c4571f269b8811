#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <sys/resource.h>
#include <unistd.h>

#include <deque>
#include <string>

#include "support/ask_node.h"
#include "support/call_service.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/tcpros_client.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

/// Lets a node have this many file descriptors.
void limitDescriptors(const std::string& node, rlim_t most) {
  const auto process = static_cast<int>(askNode(node, "getPid"));
  const rlimit limit{most, most};
  ASSERT_EQ(prlimit(process, RLIMIT_NOFILE, &limit, nullptr), 0);
}

TEST(Descriptors, ThatSilentClientsTakeAreFreed) {
  NodeUnderTest node;
  node.start();
  const Recorder<DiagnosticArray> diagnostics("/diagnostics");
  ASSERT_TRUE(waitUntil([&] { return diagnostics.connected(); }));
  ASSERT_NO_FATAL_FAILURE(limitDescriptors(node.name(), 64));

  std::deque<TcprosClient> silent;
  while (silent.size() < 100) silent.emplace_back(node.full("x/move_to"));

  // The emergency stop doesn't wait until there is room.
  EXPECT_TRUE(callWhenThere<std_srvs::Trigger>(node.full("emergency_stop")).success);
  EXPECT_TRUE(diagnostics.waitFor([](const DiagnosticArray& array) {
    for (const DiagnosticStatus& status : array.status) {
      if (status.name.find(": file descriptors") == std::string::npos) continue;
      if (status.level == DiagnosticStatus::WARN) return true;
    }
    return false;
  }));
  for (const TcprosClient& client : silent) EXPECT_TRUE(client.isClosed());
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  expectSays(node.process().output(), "idle connections are ended");
}

TEST(Descriptors, OfClientsThatWaitAreKeptWhileThereAreEnough) {
  NodeUnderTest node;
  node.start();
  const TcprosClient silent(node.full("x/move_to"));
  usleep(2'500'000);  // longer than a client may be silent if few are left
  EXPECT_TRUE(silent.introduce(node.full("x/reset"), true)) << "it is still connected";
}

}  // namespace
}  // namespace stepdriver::node_test
