// Floods of clients that keep no rules.
#include <gtest/gtest.h>
#include <stepdriver/Plan.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "flood.h"
#include "flooded_node.h"
#include "raw_connection.h"
#include "support/ask_node.h"
#include "support/message_bytes.h"
#include "support/tcpros_client.h"
#include "tcpros_bytes.h"

namespace stepdriver::bad_days {
namespace {

using node_test::bytesOf;
using node_test::headerBytes;
using node_test::lengthBytes;
using node_test::servicePort;

constexpr std::size_t kConnections = 1000;

/// A crowd of clients of one node. It has a fixed number of connections: each new one replaces the
/// oldest.
class HostileClients : public FloodedNode {
 protected:
  HostileClients()
      : calls(servicePort(node_.full("x/move_to"))),
        emergency(servicePort(node_.full("emergency_stop"))),
        xml_rpc(node_test::xmlRpcPort(node_.name())) {
    raiseDescriptorLimit();
  }
  void TearDown() override {
    connections_.clear();
    FloodedNode::TearDown();
  }

  /// @param receive_buffer see RawConnection.
  const RawConnection& connect(std::uint16_t port, int receive_buffer = 0) {
    if (connections_.size() == kConnections) connections_.pop_front();
    return connections_.emplace_back(port, receive_buffer);
  }
  /// A number below a limit.
  std::size_t below(std::size_t limit) { return random_() % limit; }
  std::uint16_t anyPort() { return std::vector{calls, emergency, xml_rpc}[below(3)]; }
  std::string garbage(std::size_t most) {
    std::string bytes(1 + below(most), '\0');
    for (char& byte : bytes) byte = static_cast<char>(random_());
    return bytes;
  }

  // The node's ports: of topics and most services, of emergency_stop, and of XML-RPC.
  const std::uint16_t calls;
  const std::uint16_t emergency;
  const std::uint16_t xml_rpc;

  std::deque<RawConnection> connections_;

 private:
  std::mt19937 random_{20261122};
};

std::string subscription(const std::string& topic) {
  return headerBytes({{"callerid", "/flood"},
                      {"md5sum", "*"},
                      {"topic", topic},
                      {"type", "sensor_msgs/JointState"}});
}

TEST_F(HostileClients, ThatNeverRead) {
  const std::string plan = bytesOf(Plan::Request());
  std::string plans;
  for (int i = 0; i < 1000; ++i) {
    plans += lengthBytes(static_cast<std::uint32_t>(plan.size())) + plan;
  }
  const auto begin = [&] {
    constexpr int kSmallBuffer = 4096;
    switch (below(8)) {
      case 0:  // A call would end the moves that the test begins.
        connect(emergency, kSmallBuffer).send(introduction(node_.full("emergency_stop")));
        break;
      case 1:
      case 2:
        connect(calls, kSmallBuffer).send(subscription(node_.beside("joint_states")));
        break;
      default:
        connect(calls, kSmallBuffer).send(introduction(node_.full("x/plan")) + plans);
    }
  };
  while (connections_.size() < kConnections) begin();
  const Flood flood(100.0, begin);
  endure([&] { return "1000 connections that read nothing, 100 of them new each second"; });
}

TEST_F(HostileClients, ThatNeverEndTheirHeader) {
  const std::string header = introduction(node_.full("emergency_stop"));
  const auto begin = [&] { connect(anyPort()).send(header.substr(0, below(header.size() - 1))); };
  while (connections_.size() < kConnections) begin();
  const Flood flood(1000.0, begin);
  endure(
      [&] { return perSecond(flood.rate(), "connections with a part of a header, 1000 at once"); });
}

TEST_F(HostileClients, ThatSendGarbage) {
  const Flood flood(1000.0, [this] { connect(anyPort()).send(garbage(5000)); });
  endure([&] { return perSecond(flood.rate(), "connections with random bytes"); });
}

TEST_F(HostileClients, ThatSendGarbageByTcpros) {
  const std::vector<std::string> services{node_.full("x/move_to"), node_.full("home"),
                                          node_.full("emergency_stop")};
  const Flood flood(1000.0, [&] {
    std::string bytes;
    switch (below(4)) {
      case 0:  // a header of random fields
        bytes = headerBytes({{garbage(20), garbage(200)}, {"service", garbage(50)}});
        break;
      case 1:  // a header that isn't one
        bytes = garbage(300);
        bytes = lengthBytes(static_cast<std::uint32_t>(bytes.size())) + bytes;
        break;
      case 2:  // requests of random lengths, up to 4 GB
        bytes = introduction(services[below(3)]) + garbage(1000);
        break;
      default:  // requests of random bytes
        bytes = introduction(services[below(3)]);
        for (int i = 0; i < 5; ++i) {
          const std::string request = garbage(100);
          bytes += lengthBytes(static_cast<std::uint32_t>(request.size())) + request;
        }
    }
    connect(below(3) == 0 ? emergency : calls).send(bytes);
  });
  endure([&] { return perSecond(flood.rate(), "connections with false headers and requests"); });
}

/// A call of XML-RPC with this text in place of its parameters.
std::string xmlRpcCall(const std::string& method, const std::string& parameters,
                       const std::string& length = {}) {
  const std::string body = "<?xml version=\"1.0\"?><methodCall><methodName>" + method +
                           "</methodName><params>" + parameters + "</params></methodCall>";
  return "POST /RPC2 HTTP/1.1\r\nHost: machine\r\nContent-Type: text/xml\r\nContent-length: " +
         (length.empty() ? std::to_string(body.size()) : length) + "\r\n\r\n" + body;
}

TEST_F(HostileClients, ThatSendGarbageByXmlRpc) {
  const std::vector<std::string> methods{"getPid", "requestTopic", "publisherUpdate", "paramUpdate",
                                         "system.multicall"};
  const std::vector<std::string> parts{"<param>",
                                       "</param>",
                                       "<value>",
                                       "</value>",
                                       "<array><data>",
                                       "</data></array>",
                                       "<struct>",
                                       "</struct>",
                                       "<member>",
                                       "</member>",
                                       "<name>a</name>",
                                       "<i4>1</i4>",
                                       "<int>99999999999999999999</int>",
                                       "<double>1e999</double>",
                                       "<string>&amp;&lt;&#0;</string>",
                                       "<base64>////</base64>",
                                       "<dateTime.iso8601>99999999T99:99:99</dateTime.iso8601>",
                                       "<"};
  const std::vector<std::string> lengths{"0", "-1", "2147483647", "99999999999999999999", "a"};
  const Flood flood(1000.0, [&] {
    const std::string& method = methods[below(methods.size())];
    std::string text;
    switch (below(3)) {
      case 0:
        for (std::size_t i = below(100); i > 0; --i) text += parts[below(parts.size())];
        connect(xml_rpc).send(xmlRpcCall(method, text));
        break;
      case 1:
        connect(xml_rpc).send(xmlRpcCall(method, garbage(1000)));
        break;
      default:
        connect(xml_rpc).send(xmlRpcCall(method, garbage(100), lengths[below(lengths.size())]));
    }
  });
  endure([&] { return perSecond(flood.rate(), "connections with false calls of XML-RPC"); });
}

}  // namespace
}  // namespace stepdriver::bad_days
