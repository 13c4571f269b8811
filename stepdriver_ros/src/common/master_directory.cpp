#include "master_directory.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcException.h>

#include "xmlrpc_caller.h"

namespace stepdriver::ros_node {
namespace {

template <typename... Arguments>
std::optional<XmlRpcCaller::Answer> ask(const char* method, const Arguments&... arguments) {
  XmlRpcCaller master(ros::master::getHost(), ros::master::getPort(), kMasterPatience);
  return master.call(method, ros::this_node::getName(), arguments...);
}

}  // namespace

std::optional<Publishers> MasterDirectory::publishers() {
  auto state = ask("getSystemState");
  if (!state || state->code != 1) return std::nullopt;
  Publishers publishers;
  try {
    XmlRpc::XmlRpcValue& topics = state->value[0];  // each is [topic, [node, ...]]
    for (int i = 0; i < topics.size(); ++i) {
      std::vector<std::string>& names = publishers[static_cast<std::string>(topics[i][0])];
      XmlRpc::XmlRpcValue& nodes = topics[i][1];
      for (int j = 0; j < nodes.size(); ++j) names.push_back(static_cast<std::string>(nodes[j]));
    }
  } catch (const XmlRpc::XmlRpcException&) {
    return std::nullopt;  // It isn't a master's answer.
  }
  return publishers;
}

std::optional<std::string> MasterDirectory::addressOf(const std::string& node) {
  auto found = ask("lookupNode", node);
  if (!found) return std::nullopt;
  if (found->code != 1) return std::string();
  if (found->value.getType() != XmlRpc::XmlRpcValue::TypeString) return std::nullopt;
  return static_cast<std::string>(found->value);
}

}  // namespace stepdriver::ros_node
