#include "support/ask_node.h"

#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cstdint>

namespace stepdriver::node_test {

namespace {

struct Address {
  std::string host;
  std::uint32_t port = 0;
};

Address addressOf(const std::string& node) {
  XmlRpc::XmlRpcValue request;
  request[0] = ros::this_node::getName();
  request[1] = node;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue uri;
  EXPECT_TRUE(ros::master::execute("lookupNode", request, response, uri, false)) << node;
  Address address;
  EXPECT_TRUE(ros::network::splitURI(static_cast<std::string&>(uri), address.host, address.port));
  return address;
}

}  // namespace

std::uint16_t xmlRpcPort(const std::string& node) {
  return static_cast<std::uint16_t>(addressOf(node).port);
}

XmlRpc::XmlRpcValue askNode(const std::string& node, const std::string& method,
                            const std::string& why) {
  const Address address = addressOf(node);
  XmlRpc::XmlRpcClient client(address.host.c_str(), static_cast<int>(address.port), "/");
  XmlRpc::XmlRpcValue question;
  question[0] = ros::this_node::getName();
  if (!why.empty()) question[1] = why;
  XmlRpc::XmlRpcValue response;
  EXPECT_TRUE(client.execute(method.c_str(), question, response)) << node << ", " << method;
  return response[2];
}

}  // namespace stepdriver::node_test
