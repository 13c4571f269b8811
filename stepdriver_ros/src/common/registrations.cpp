#include "registrations.h"

#include <ros/network.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <map>

namespace stepdriver::ros_node {
namespace {

using XmlRpc::XmlRpcValue;

/// The names in one of the lists of getSystemState, [name, [node, ...]], that have this node.
std::vector<std::string> namesOf(XmlRpcValue& list, const std::string& node) {
  std::vector<std::string> names;
  for (int i = 0; i < list.size(); ++i) {
    XmlRpcValue& nodes = list[i][1];
    for (int j = 0; j < nodes.size(); ++j) {
      if (static_cast<std::string>(nodes[j]) == node) names.emplace_back(list[i][0]);
    }
  }
  return names;
}

bool succeeded(const std::optional<XmlRpcCaller::Answer>& answer) {
  return answer && answer->code == 1;
}

}  // namespace

std::optional<Registrations> Registrations::read(XmlRpcCaller& master, const std::string& node) {
  auto state = master.call("getSystemState", node);
  auto types = master.call("getTopicTypes", node);
  if (!succeeded(state) || !succeeded(types)) return std::nullopt;
  Registrations all;
  all.node_ = node;
  try {
    std::map<std::string, std::string> type_of;
    for (int i = 0; i < types->value.size(); ++i) {
      type_of[static_cast<std::string>(types->value[i][0])] =
          static_cast<std::string>(types->value[i][1]);
    }
    for (const std::string& name : namesOf(state->value[0], node)) {
      all.published_.push_back({name, type_of[name]});
    }
    for (const std::string& name : namesOf(state->value[1], node)) {
      all.subscribed_.push_back({name, type_of[name]});
    }
    for (const std::string& name : namesOf(state->value[2], node)) {
      auto uri = master.call("lookupService", node, name);
      if (!succeeded(uri)) return std::nullopt;
      all.services_.push_back({name, static_cast<std::string>(uri->value)});
    }
  } catch (const XmlRpc::XmlRpcException&) {
    return std::nullopt;  // It isn't a master's answer.
  }
  if (all.services_.empty()) return std::nullopt;
  return all;
}

bool Registrations::registerAgain(XmlRpcCaller& master, const std::string& node_uri) const {
  for (const Service& service : services_) {
    if (!succeeded(master.call("registerService", node_, service.name, service.uri, node_uri))) {
      return false;
    }
  }
  for (const Topic& topic : published_) {
    if (!succeeded(master.call("registerPublisher", node_, topic.name, topic.type, node_uri))) {
      return false;
    }
  }
  for (const Topic& topic : subscribed_) {
    if (!subscribeAgain(master, topic, node_uri)) return false;
  }
  return true;
}

// The node learns of publishers by the call that masters make for it. A publisher may register
// between the two calls: then the master's own call may come before ours, with its older list.
bool Registrations::subscribeAgain(XmlRpcCaller& master, const Topic& topic,
                                   const std::string& node_uri) const {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(node_uri, host, port)) return false;
  XmlRpcCaller node(host, port, master.patience());
  std::optional<XmlRpcValue> told;
  for (;;) {
    const auto publishers =
        master.call("registerSubscriber", node_, topic.name, topic.type, node_uri);
    if (!succeeded(publishers)) return false;
    if (told == publishers->value) return true;
    if (!succeeded(node.call("publisherUpdate", "/master", topic.name, publishers->value))) {
      return false;
    }
    told = publishers->value;
  }
}

}  // namespace stepdriver::ros_node
