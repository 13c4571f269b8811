#include "support/tcpros_client.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/service_traits.h>
#include <ros/this_node.h>
#include <std_srvs/Trigger.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>

#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

constexpr std::size_t kMostReceived = 100000;

std::uint32_t lengthOf(const std::string& bytes) {
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    length |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes.at(i))) << (8 * i);
  }
  return length;
}

}  // namespace

std::string serviceUri(const std::string& service) {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue uri;
  request[0] = ros::this_node::getName();
  request[1] = service;
  const bool found = ros::master::execute("lookupService", request, response, uri, false);
  EXPECT_TRUE(found) << "the master knows no " << service;
  return found ? static_cast<std::string>(uri) : std::string();
}

std::uint16_t servicePort(const std::string& service) {
  std::string host;
  std::uint32_t port = 0;
  EXPECT_TRUE(ros::network::splitURI(serviceUri(service), host, port)) << service;
  return static_cast<std::uint16_t>(port);
}

TcprosClient::TcprosClient(std::uint16_t port, int receive_buffer)
    : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
  if (receive_buffer > 0) {
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof(receive_buffer));
  }
  timeval bound{};
  bound.tv_sec = kBound.count();
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &bound, sizeof(bound));
  setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &bound, sizeof(bound));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0)
      << "no connection to port " << port << ", errno " << errno;
}

TcprosClient::~TcprosClient() { close(socket_); }

void TcprosClient::resetAtEnd() const {
  const linger at_once{1, 0};
  setsockopt(socket_, SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once));
}

bool TcprosClient::send(const std::string& bytes) const {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) return false;
    sent += static_cast<std::size_t>(count);
  }
  return true;
}

std::size_t TcprosClient::sendAtOnce(const std::string& bytes) const {
  const ssize_t count = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  return count < 0 ? 0 : static_cast<std::size_t>(count);
}

std::string TcprosClient::receive(std::size_t bytes) const {
  std::string received(bytes, '\0');
  std::size_t there = 0;
  while (there < bytes) {
    const ssize_t count = recv(socket_, received.data() + there, bytes - there, 0);
    if (count <= 0) break;
    there += static_cast<std::size_t>(count);
  }
  received.resize(there);
  return received;
}

TcprosClient::Header TcprosClient::receiveHeader() const {
  Header header;
  const std::string length = receive(4);
  if (length.size() < 4 || lengthOf(length) > kMostReceived) return header;
  const std::string bytes = receive(lengthOf(length));
  for (std::size_t begin = 0; begin + 4 <= bytes.size();) {
    const std::string field = bytes.substr(begin + 4, lengthOf(bytes.substr(begin, 4)));
    begin += 4 + field.size();
    const std::size_t equals = field.find('=');
    if (equals != std::string::npos) header[field.substr(0, equals)] = field.substr(equals + 1);
  }
  return header;
}

bool TcprosClient::isClosed() const {
  char byte = 0;
  for (;;) {
    const ssize_t count = recv(socket_, &byte, 1, 0);
    if (count <= 0) return count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK);
  }
}

bool TcprosClient::introduce(const std::string& service, bool persistent) const {
  if (!send(introduction(service, persistent))) return false;
  const Header header = receiveHeader();
  return !header.empty() && header.count("error") == 0;
}

bool TcprosClient::request(const std::string& fields) const {
  return send(lengthBytes(static_cast<std::uint32_t>(fields.size())) + fields);
}

std::optional<std::string> TcprosClient::answer() const {
  const std::string begin = receive(5);
  if (begin.size() < 5 || begin[0] != 1 || lengthOf(begin.substr(1)) > kMostReceived) return {};
  const std::uint32_t length = lengthOf(begin.substr(1));
  std::string fields = receive(length);
  if (fields.size() != length) return {};
  return fields;
}

bool TcprosClient::call() const {
  if (!request({})) return false;
  const std::optional<std::string> fields = answer();
  return fields && fields->size() >= 5 && fields->front() == 1;
}

std::string lengthBytes(std::uint32_t length) {
  std::string bytes;
  for (std::size_t i = 0; i < 4; ++i) bytes += static_cast<char>((length >> (8 * i)) & 0xFFU);
  return bytes;
}

std::string headerBytes(const TcprosClient::Header& header) {
  std::string fields;
  for (const auto& [name, value] : header) {
    fields += lengthBytes(static_cast<std::uint32_t>(name.size() + 1 + value.size()));
    fields += name;
    fields += '=';
    fields += value;
  }
  return lengthBytes(static_cast<std::uint32_t>(fields.size())) + fields;
}

std::string introduction(const std::string& service, bool persistent) {
  TcprosClient::Header header{{"callerid", "/a_test"},
                              {"md5sum", ros::service_traits::md5sum<std_srvs::Trigger>()},
                              {"service", service},
                              {"type", "std_srvs/Trigger"}};
  if (persistent) header["persistent"] = "1";
  return headerBytes(header);
}

}  // namespace stepdriver::node_test
