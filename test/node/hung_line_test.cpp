#include <fcntl.h>
#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <future>
#include <string>

#include "support/node_under_test.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

// On the rig the pulse thread writes the trace. If that is a pipe that nobody empties, a write of
// STEP doesn't return, as with a GPIO chip that doesn't answer.
TEST(HungLine, IsToldToAllClientsAndDoesNotHoldUpTheEnd) {
  const TemporaryFile pipe(".pipe");
  ASSERT_EQ(mkfifo(pipe.path().c_str(), 0600), 0);
  const int reader = open(pipe.path().c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  NodeUnderTest node;
  node.set("simulation/trace", pipe.path());
  node.set("simulation/trace_overwrites_any_file", true);
  node.start();
  auto waiting = std::async(std::launch::async, [&node] {
    for (;;) {
      auto answer = node.moveTo(0.2, true);
      if (!answer.success) return answer;
      auto back = node.moveTo(0.0, true);
      if (!back.success) return back;
    }
  });
  if (waiting.wait_for(kBound) != std::future_status::ready) {
    node.process().signal(SIGKILL);
    FAIL() << "the client waits";
  }
  const std::string why = "ETIMEDOUT, the chip doesn't answer";
  expectSays(waiting.get().message, why);
  for (const char* service : {"emergency_stop", "stop", "x/stop", "recover"}) {
    const auto answer = node.call<std_srvs::Trigger>(service);
    EXPECT_FALSE(answer.success) << service;
    expectSays(answer.message, why);
  }
  EXPECT_FALSE(node.moveTo(0.1, true).success);
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 2);
  expectSays(node.process().output(), "cut the power of the motors");
  close(reader);
}

}  // namespace
}  // namespace stepdriver::node_test
