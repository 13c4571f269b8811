#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <sys/resource.h>

#include <cstddef>
#include <cstdint>
#include <deque>

#include "support/call_service.h"
#include "support/node_under_test.h"
#include "support/tcpros_client.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

constexpr std::size_t kDescriptors = 64;
constexpr std::size_t kSilentClients = 100;
constexpr double kFar = 0.19;      // [m]
constexpr double kSlowly = 0.001;  // [m/s]

TEST(Descriptors, ThatSilentClientsTakeAreNotThoseOfTheStops) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const rlimit limit{kDescriptors, kDescriptors};
  ASSERT_EQ(prlimit(node.process().pid(), RLIMIT_NOFILE, &limit, nullptr), 0);
  ASSERT_TRUE(node.moveTo(kFar, false, kSlowly).success);
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 0; }));

  std::deque<TcprosClient> silent;
  while (silent.size() < kSilentClients) silent.emplace_back(node.full("x/move_to"));
  // roscpp needs one more than the last for each client that it accepts, and turns it away.
  ASSERT_TRUE(waitUntil([&] { return node.process().descriptors() >= kDescriptors - 1; }));
  EXPECT_TRUE(callWhenThere<std_srvs::Trigger>(node.full("emergency_stop")).success);

  silent.clear();
  const std::int64_t stopped = node.pulses();
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  EXPECT_EQ(node.pulses(), stopped);
  EXPECT_TRUE(node.moveTo(0.01, true).success);
}

}  // namespace
}  // namespace stepdriver::node_test
