// Floods of calls that keep the rules, but are too many.
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/SpeedOverride.h>

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>

#include "flood.h"
#include "flooded_node.h"
#include "support/message_bytes.h"
#include "support/tcpros_client.h"
#include "tcpros_bytes.h"

namespace stepdriver::bad_days {
namespace {

using node_test::bytesOf;
using node_test::servicePort;
using node_test::TcprosClient;

std::string speedOverride() {
  SpeedOverride::Request request;
  request.factor = 1.0;
  return bytesOf(request);
}

/// Opens a connection, calls a service and ends the connection.
void callOnce(std::uint16_t port, const std::string& service, const std::string& request) {
  const TcprosClient client(port);
  client.resetAtEnd();
  EXPECT_TRUE(client.send(introduction(service)));
  EXPECT_EQ(client.receiveHeader().count("type"), 1U) << service;
  EXPECT_TRUE(client.request(request));
  EXPECT_TRUE(client.answer()) << service;
}

TEST_F(FloodedNode, ByTenThousandCallsASecond) {
  constexpr int kClients = 20;
  const std::string service = node_.full("speed_override");
  const std::uint16_t port = servicePort(service);
  std::deque<TcprosClient> clients;
  for (int i = 0; i < kClients; ++i) {
    ASSERT_TRUE(clients.emplace_back(port).send(introduction(service)));
    ASSERT_EQ(clients.back().receiveHeader().count("type"), 1U);
  }
  const std::string request = speedOverride();
  Flood flood(10'000.0 / kClients, [&] {
    for (const TcprosClient& client : clients) EXPECT_TRUE(client.request(request));
    for (const TcprosClient& client : clients) EXPECT_TRUE(client.answer());
  });
  endure([&] { return perSecond(kClients * flood.rate(), "calls"); });
}

TEST_F(FloodedNode, ByAThousandFreshConnectionsASecond) {
  const std::string service = node_.full("speed_override");
  const std::uint16_t port = servicePort(service);
  const std::string request = speedOverride();
  const auto call = [&] { callOnce(port, service, request); };
  const Flood one(500.0, call);
  const Flood other(500.0, call);
  endure([&] { return perSecond(one.rate() + other.rate(), "connections with a call each"); });
}

TEST_F(FloodedNode, ByAThousandFreshConnectionsASecondToTheEmergencyStop) {
  const std::string service = node_.full("emergency_stop");
  const std::uint16_t port = servicePort(service);
  // A probe: a call would end the moves that the test begins.
  const Flood flood(1000.0, [&] {
    const TcprosClient client(port);
    client.resetAtEnd();
    EXPECT_TRUE(client.send(introduction(service)));
    EXPECT_EQ(client.receiveHeader().count("type"), 1U);
  });
  endure([&] { return perSecond(flood.rate(), "connections to emergency_stop"); });
}

// A disable waits until the axis is at rest.
TEST_F(FloodedNode, ByTwoHundredWaitingCalls) {
  constexpr int kClients = 200;
  const std::string service = node_.full("x/enable");
  const std::uint16_t port = servicePort(service);
  const std::string disable = bytesOf(std_srvs::SetBool::Request());
  int answered = 0;
  const auto begin = std::chrono::steady_clock::now();
  do {
    std::deque<TcprosClient> clients;
    ASSERT_NO_FATAL_FAILURE(beginMove());
    for (int i = 0; i < kClients; ++i) {
      ASSERT_TRUE(clients.emplace_back(port).send(introduction(service)));
      ASSERT_EQ(clients.back().receiveHeader().count("type"), 1U);
      ASSERT_TRUE(clients.back().request(disable));
    }
    endMove();
    for (const TcprosClient& client : clients) {
      ASSERT_TRUE(client.answer()) << answered << " calls have got their answer";
      ++answered;
    }
  } while (std::chrono::steady_clock::now() - begin < seconds());
  endure([&] { return std::to_string(answered) + " calls that waited, 200 at a time"; });
}

}  // namespace
}  // namespace stepdriver::bad_days
