// Clients that claim large messages and don't send them.
#include "node/calls/frame_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <string>

#include "support/node_under_test.h"
#include "support/says.h"
#include "support/tcpros_client.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

class FrameMemory : public testing::Test {
 protected:
  FrameMemory() : service(node.full("x/reset")) {
    // Otherwise glibc reserves 64 MB or more for each thread that finds the others' heaps in use.
    setenv("MALLOC_ARENA_MAX", "1", 1);
    node.start();
    before = reserved();
  }
  void SetUp() override {
    if (node.process().output().find("Large messages have no common limit") != std::string::npos) {
      GTEST_SKIP() << "this roscpp calls its functions directly, and the node says so";
    }
  }

  std::size_t reserved() { return node.process().kilobytes("VmSize"); }

  /// A client that claims to send a request of this size.
  TcprosClient& claim(std::uint32_t bytes) {
    TcprosClient& client = clients.emplace_back(service);
    EXPECT_TRUE(client.introduce(service, true));
    EXPECT_TRUE(client.send(lengthBytes(bytes)));
    return client;
  }

  NodeUnderTest node;
  const std::string service;
  std::deque<TcprosClient> clients;
  std::size_t before = 0;  // [kB]
};

TEST_F(FrameMemory, IsNotReservedForWhatClientsOnlyClaim) {
  // Less than what the clients claim together.
  const rlim_t most = rlim_t{before} * 1024 + (rlim_t{2} << 30);
  const rlimit limit{most, most};
  ASSERT_EQ(prlimit(node.process().pid(), RLIMIT_AS, &limit, nullptr), 0);

  for (int i = 0; i < 8; ++i) EXPECT_TRUE(claim(999'999'999).isClosed()) << i;

  EXPECT_LT(reserved(), before + 100'000) << "kB";
  expectSays(node.process().output(), "claims to send 999999999 bytes");
  EXPECT_TRUE(node.moveTo(0.01, true).success);
}

TEST_F(FrameMemory, IsSharedByLargeMessages) {
  constexpr std::uint32_t kThird = ros_node::kMostFrameMemory / 3;
  for (int i = 0; i < 3; ++i) claim(kThird);
  EXPECT_TRUE(waitUntil([&] { return reserved() > before + 3 * (kThird / 1024); }));
  EXPECT_TRUE(claim(kThird).isClosed());

  clients.clear();
  EXPECT_TRUE(waitUntil([&] { return reserved() < before + kThird / 1024; }));
  const TcprosClient& client = claim(kThird);
  EXPECT_TRUE(client.send(std::string(kThird, '\0')));
  EXPECT_TRUE(client.answer());  // a request without fields ignores the bytes
  EXPECT_TRUE(node.moveTo(0.01, true).success);
}

}  // namespace
}  // namespace stepdriver::node_test
