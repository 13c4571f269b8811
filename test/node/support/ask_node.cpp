#include "support/ask_node.h"

#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cstdint>

namespace stepdriver::node_test {

XmlRpc::XmlRpcValue askNode(const std::string& node, const std::string& method,
                            const std::string& why) {
  XmlRpc::XmlRpcValue request;
  request[0] = ros::this_node::getName();
  request[1] = node;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue uri;
  EXPECT_TRUE(ros::master::execute("lookupNode", request, response, uri, false)) << node;
  std::string host;
  std::uint32_t port = 0;
  EXPECT_TRUE(ros::network::splitURI(static_cast<std::string&>(uri), host, port));
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue question;
  question[0] = ros::this_node::getName();
  if (!why.empty()) question[1] = why;
  EXPECT_TRUE(client.execute(method.c_str(), question, response)) << node << ", " << method;
  return response[2];
}

}  // namespace stepdriver::node_test
