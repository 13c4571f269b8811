#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/MoveTo.h>

#include <csignal>
#include <cstdint>
#include <future>
#include <string>
#include <vector>

#include "support/fault_injection.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// A computer that has no thread or no memory left.

namespace stepdriver::node_test {
namespace {

constexpr int kExitGpio = 2;
constexpr int kExitExhausted = 5;
constexpr int kAborted = 128 + SIGABRT;

class Exhausted : public testing::Test {
 protected:
  Exhausted() { node.set("simulation/speed", 1.0); }

  bool isReady() { return node.process().output().find("Ready") != std::string::npos; }

  /// Launches the node. @return its exit code, or -1 if it is ready.
  int launch() {
    NodeProcess& process = node.launch();
    EXPECT_TRUE(waitUntil([&] {
      return isReady() || process.waitForExit(std::chrono::seconds(0));
    })) << "it neither starts nor ends: "
        << process.output();
    return isReady() ? -1 : process.waitForExit(std::chrono::seconds(0)).value_or(-2);
  }

  /// Ends a node that is ready.
  void expectAnEnd(int exit_code) {
    node.process().signal(SIGTERM);
    EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), exit_code)
        << node.process().output();
  }

  const FaultInjection faults;
  NodeUnderTest node;
};

class ExhaustedThreads : public Exhausted {};

// Some of these threads are roscpp's, which ends the process.
TEST_F(ExhaustedThreads, AtTheStartEndTheNodeOrLetItServe) {
  int refused = 0;
  for (std::int64_t threads = 0; threads < 25; ++threads) {
    SCOPED_TRACE(threads);
    faults->threads_left = threads;
    const int exit_code = launch();
    if (exit_code == -1) {
      faults->threads_left = -1;
      EXPECT_TRUE(node.moveTo(0.001, true).success);
      EXPECT_TRUE(node.moveTo(0.0, true).success);
      expectAnEnd(0);
      continue;
    }
    EXPECT_TRUE(exit_code == kExitExhausted || exit_code == kExitGpio || exit_code == kAborted)
        << exit_code << ": " << node.process().output();
    // The thread that writes the lines of a chip.
    if (exit_code == kExitGpio)
      expectSays(node.process().output(), "Resource temporarily unavailable");
    if (exit_code == kExitExhausted) {
      ++refused;
      expectSays(node.process().output(), "no thread can be started");
    }
  }
  EXPECT_GT(refused, 0);
}

TEST_F(ExhaustedThreads, LaterHoldUpNoMoveNoStopAndNoEnd) {
  node.start();
  faults->threads_left = 0;
  auto waiting = std::async(std::launch::async, [this] { return node.moveTo(0.15, true); });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 1000; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
  EXPECT_FALSE(waiting.get().success);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("emergency_stop").success);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  const auto answer = node.moveTo(0.0, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
  expectAnEnd(0);
}

class ExhaustedMemory : public Exhausted {};

// The node may be ready some time before its allocations are counted.
TEST_F(ExhaustedMemory, AtTheStartEndsTheNode) {
  ASSERT_EQ(launch(), -1);
  const std::int64_t needed = faults->allocations;
  expectAnEnd(0);
  ASSERT_GT(needed, 1000);
  int ended = 0;
  for (int part = 1; part < 20; ++part) {
    SCOPED_TRACE(part);
    faults->allocations_left = needed * part / 20;
    const int exit_code = launch();
    if (exit_code == -1) {
      node.process().signal(SIGKILL);
      node.process().waitForExit(kBound);
      break;
    }
    EXPECT_GT(exit_code, 0) << node.process().output();
    ++ended;
  }
  EXPECT_GE(ended, 4);
}

TEST_F(ExhaustedMemory, DuringAMoveEndsTheNodeLikeSigkill) {
  const TemporaryFile state(".state");
  const TemporaryFile lock(".state.lock");
  node.set("state_file", state.path());
  node.set("axes/x/holds_position_unpowered", true);
  node.start();
  EXPECT_TRUE(node.moveTo(0.008, true).success);
  EXPECT_TRUE(node.moveTo(0.15, false, 0.001).success);
  ASSERT_TRUE(waitUntil([&state] {
    const std::string text = state.text();
    return text.find("80000 0.008") != std::string::npos && text.find(" 1\n") != std::string::npos;
  })) << state.text();
  faults->allocations_left = 0;
  MoveTo call;
  call.request.position = 0.1;
  EXPECT_FALSE(callService(node.full("x/move_to"), call) && call.response.success);
  EXPECT_GT(node.process().waitForExit(kBound).value_or(-1), 0) << node.process().output();
  faults->allocations_left = -1;
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_TRUE(states.waitFor([](const AxisStates&) { return true; }));
  const AxisStates first = states.messages().front();
  EXPECT_FALSE(first.position_valid.at(0));
  EXPECT_DOUBLE_EQ(first.position.at(0), 0.008);
  expectSays(first.position_note.at(0), "was moving, from 0.008 m");
  EXPECT_EQ(node.pulses(), 0);
}

}  // namespace
}  // namespace stepdriver::node_test
