#include "node/calls/trigger_server.h"

#include <gtest/gtest.h>
#include <ros/service.h>
#include <ros/this_node.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "support/tcpros_client.h"
#include "support/wait.h"

namespace stepdriver::ros_node {
namespace {

using node_test::headerBytes;
using node_test::introduction;
using node_test::kBound;
using node_test::lengthBytes;
using node_test::TcprosClient;
using node_test::waitUntil;

const std::string kService = "/trigger_server/act";

/// A server with a service that counts its calls, and can make them wait.
class TriggerServerTest : public testing::Test {
 public:
  ~TriggerServerTest() override { hold(false); }

 protected:
  TriggerServerTest() {
    server_.advertise(kService, [this](std_srvs::Trigger::Request& /*request*/,
                                       std_srvs::Trigger::Response& response) {
      std::unique_lock<std::mutex> lock(mutex_);
      ++calls_;
      changed_.notify_all();
      changed_.wait(lock, [this] { return !held_; });
      response.success = true;
      response.message = "done";
      return true;
    });
    server_.start();
  }

  void hold(bool held) {
    const std::lock_guard<std::mutex> lock(mutex_);
    held_ = held;
    changed_.notify_all();
  }
  bool awaitCalls(int calls) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, kBound, [&] { return calls_ >= calls; });
  }
  /// What every correct client gets, whatever others do.
  static void expectService() {
    const TcprosClient client(kService);
    EXPECT_TRUE(client.introduce(kService, false)) << "no answer to the header";
    EXPECT_TRUE(client.call()) << "no answer to the request";
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  bool held_ = false;
  int calls_ = 0;
  TriggerServer server_{"trigger server"};
};

TEST_F(TriggerServerTest, ServesAPersistentClientAgainAndAgain) {
  const TcprosClient client(kService);
  ASSERT_TRUE(client.introduce(kService, true));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(client.call()) << "call " << i;
  EXPECT_EQ(calls_, 100);
}

TEST_F(TriggerServerTest, ServesAnotherClientOnce) {
  const TcprosClient client(kService);
  ASSERT_TRUE(client.introduce(kService, false));
  EXPECT_TRUE(client.call());
  EXPECT_FALSE(client.call());
  EXPECT_TRUE(client.isClosed());
  EXPECT_EQ(calls_, 1);
}

TEST_F(TriggerServerTest, TakesHeadersAndRequestsInSingleBytes) {
  const TcprosClient client(kService);
  for (const char byte : introduction(kService, true)) {
    ASSERT_TRUE(client.send(std::string(1, byte)));
  }
  EXPECT_EQ(client.receiveHeader()["type"], "std_srvs/Trigger");
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(client.send(std::string(1, '\0')));
  expectService();
  EXPECT_EQ(calls_, 1) << "a part of a request is none";
  ASSERT_TRUE(client.send(std::string(1, '\0')));
  EXPECT_EQ(client.receive(1), std::string(1, '\1'));
}

TEST_F(TriggerServerTest, AnswersWhatIsSentInOneGoOneByOne) {
  const TcprosClient client(kService);
  std::string bytes = introduction(kService, true);
  for (int i = 0; i < 50; ++i) bytes += lengthBytes(0);
  ASSERT_TRUE(client.send(bytes));
  EXPECT_EQ(client.receiveHeader().count("error"), 0U);
  // Parts of each answer: ok, its length, success, and the message with its length.
  const std::size_t size = 1 + 4 + 1 + 4 + std::string("done").size();
  EXPECT_EQ(client.receive(50 * size).size(), 50 * size);
  EXPECT_EQ(calls_, 50);
}

TEST_F(TriggerServerTest, TellsAProbeItsTypeWithoutACall) {
  const TcprosClient client(kService);
  ASSERT_TRUE(client.send(headerBytes(
      {{"callerid", "/a_test"}, {"md5sum", "*"}, {"probe", "1"}, {"service", kService}})));
  TcprosClient::Header header = client.receiveHeader();
  EXPECT_EQ(header["type"], "std_srvs/Trigger");
  EXPECT_EQ(header["request_type"], "std_srvs/TriggerRequest");
  EXPECT_EQ(header["response_type"], "std_srvs/TriggerResponse");
  EXPECT_EQ(header["md5sum"], "937c9679a518e3a18d831e57125ea522");
  EXPECT_EQ(header["callerid"], ros::this_node::getName());
  EXPECT_EQ(calls_, 0);
}

TEST_F(TriggerServerTest, RefusesOtherHeadersWithTheReason) {
  const std::vector<std::pair<TcprosClient::Header, std::string>> headers{
      {{{"callerid", "/a"}, {"md5sum", "*"}, {"service", "/no/such"}}, "/no/such"},
      {{{"callerid", "/a"}, {"md5sum", "123"}, {"service", kService}}, "123"},
      {{{"callerid", "/a"}, {"md5sum", "*"}, {"topic", "/a"}}, "\"service\""},
      {{{"callerid", "/a"}, {"service", kService}}, "\"md5sum\""},
      {{{"md5sum", "*"}, {"service", kService}}, "\"callerid\""}};
  for (const auto& [header, reason] : headers) {
    const TcprosClient client(kService);
    ASSERT_TRUE(client.send(headerBytes(header)));
    const std::string error = client.receiveHeader()["error"];
    EXPECT_NE(error.find(reason), std::string::npos) << '"' << error << "\" without " << reason;
    client.send(lengthBytes(0));
    EXPECT_TRUE(client.isClosed()) << reason;
  }
  EXPECT_EQ(calls_, 0);
  expectService();
}

TEST_F(TriggerServerTest, ClosesConnectionsWithLyingLengths) {
  for (const std::string& bytes :
       {lengthBytes(0), lengthBytes(0xFFFFFFFF), lengthBytes(1U << 20),
        lengthBytes(8) + lengthBytes(5) + "a=bc", lengthBytes(8) + lengthBytes(0xFFFFFFFF) + "a=bc",
        lengthBytes(2) + "ab", lengthBytes(8) + lengthBytes(4) + "abcd"}) {
    const TcprosClient client(kService);
    client.send(bytes);
    EXPECT_TRUE(client.isClosed()) << bytes.size() << " bytes";
  }
  for (const std::uint32_t length : {1U, 0xFFFFFFFFU}) {
    const TcprosClient client(kService);
    ASSERT_TRUE(client.introduce(kService, true));
    client.send(lengthBytes(length));
    EXPECT_TRUE(client.isClosed()) << length;
  }
  EXPECT_EQ(calls_, 0);
  expectService();
}

TEST_F(TriggerServerTest, DropsWhatIsBegunAndNotEndedAndKeepsIdleClients) {
  const TcprosClient idle(kService);
  ASSERT_TRUE(idle.introduce(kService, true));
  const TcprosClient silent(kService);
  const TcprosClient half_header(kService);
  half_header.send(introduction(kService, true).substr(0, 20));
  const TcprosClient half_request(kService);
  ASSERT_TRUE(half_request.introduce(kService, true));
  half_request.send(lengthBytes(0).substr(0, 2));
  expectService();
  // Each call waits for kBound, which is longer than the server's patience.
  for (const TcprosClient* client : {&silent, &half_header, &half_request}) {
    EXPECT_TRUE(client->isClosed());
  }
  EXPECT_TRUE(idle.call());
}

TEST_F(TriggerServerTest, IsNotHeldUpByAClientThatReadsNoAnswers) {
  const TcprosClient deaf(kService, 4096);
  ASSERT_TRUE(deaf.introduce(kService, true));
  const TcprosClient other(kService);
  ASSERT_TRUE(other.introduce(kService, true));
  std::string requests;
  for (int i = 0; i < 10000; ++i) requests += lengthBytes(0);
  // Sends until the server accepts nothing more: its answers have filled all buffers in between.
  bool full = false;
  for (int i = 0; i < 100000 && !full; ++i) {
    full = deaf.sendAtOnce(requests) == 0;
    ASSERT_TRUE(other.call());
  }
  EXPECT_TRUE(full) << calls_ << " calls";
  EXPECT_TRUE(other.call());
}

TEST_F(TriggerServerTest, ClosesTheLongestSilentOfTooMany) {
  const TcprosClient first(kService);
  ASSERT_TRUE(first.introduce(kService, true));
  const TcprosClient second(kService);
  ASSERT_TRUE(second.introduce(kService, true));
  ASSERT_TRUE(first.call());
  std::vector<std::unique_ptr<TcprosClient>> others;
  for (std::size_t i = 2; i < TriggerServer::kMostConnections + 1; ++i) {
    others.push_back(std::make_unique<TcprosClient>(kService));
    ASSERT_TRUE(others.back()->introduce(kService, true)) << "client " << i;
  }
  EXPECT_TRUE(second.isClosed());
  EXPECT_TRUE(first.call());
  EXPECT_TRUE(others.back()->call());
}

TEST_F(TriggerServerTest, KeepsClientsThatWaitWhenManyOthersFinishNoHeader) {
  const TcprosClient waiting(kService);
  ASSERT_TRUE(waiting.introduce(kService, true));
  const std::uint16_t port = node_test::servicePort(kService);
  std::vector<std::unique_ptr<TcprosClient>> others;
  while (others.size() < 2 * TriggerServer::kMostConnections) {
    others.push_back(std::make_unique<TcprosClient>(port));
    others.back()->send(introduction(kService, true).substr(0, 20));
  }
  expectService();
  EXPECT_TRUE(others.front()->isClosed()) << "there were too many";
  EXPECT_TRUE(waiting.call());
}

/// Leaves this process no descriptors except those that are open.
class NoDescriptors {
 public:
  NoDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    rlimit none = before_;
    // The next descriptor would get the lowest free number.
    const int next = dup(0);
    close(next);
    none.rlim_cur = static_cast<rlim_t>(next);
    setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST_F(TriggerServerTest, LetsClientsInWhenTheProcessHasNoDescriptorLeft) {
  const TcprosClient busy(kService);
  ASSERT_TRUE(busy.introduce(kService, true));
  hold(true);
  ASSERT_TRUE(busy.send(lengthBytes(0)));
  ASSERT_TRUE(awaitCalls(1));
  // Two clients wait to be accepted: one gets the descriptor in reserve, the other one that of the
  // client that has been silent longest.
  const TcprosClient first(kService);
  const TcprosClient second(kService);
  {
    const NoDescriptors none;
    hold(false);
    for (const TcprosClient* client : {&first, &second}) {
      EXPECT_TRUE(client->introduce(kService, true));
      EXPECT_TRUE(client->call());
    }
  }
  EXPECT_TRUE(busy.isClosed());
  expectService();
}

TEST_F(TriggerServerTest, AnswersAtItsEndTheCallThatIsUnderWay) {
  const TcprosClient client(kService);
  const TcprosClient idle(kService);
  ASSERT_TRUE(client.introduce(kService, false));
  ASSERT_TRUE(idle.introduce(kService, true));
  hold(true);
  auto answered = std::async(std::launch::async, [&client] { return client.call(); });
  ASSERT_TRUE(awaitCalls(1));
  auto finished = std::async(std::launch::async, [this] { server_.finish(kBound); });
  EXPECT_TRUE(waitUntil([] { return !ros::service::exists(kService, false); }))
      << "the master still knows it";
  hold(false);
  EXPECT_TRUE(answered.get());
  EXPECT_TRUE(idle.isClosed());
  ASSERT_EQ(finished.wait_for(kBound), std::future_status::ready);
}

TEST_F(TriggerServerTest, EndsWithoutThoseWhoLeaveItWaiting) {
  const TcprosClient silent(kService);
  const TcprosClient idle(kService);
  ASSERT_TRUE(idle.introduce(kService, true));
  server_.finish(std::chrono::milliseconds(1));
  EXPECT_TRUE(silent.isClosed());
  EXPECT_TRUE(idle.isClosed());
  EXPECT_EQ(calls_, 0);
}

}  // namespace
}  // namespace stepdriver::ros_node
