#pragma once

#include <optional>
#include <string>
#include <vector>

#include "xmlrpc_caller.h"

namespace stepdriver::ros_node {

/// What a node has registered with the master: its topics and services.
class Registrations {
 public:
  /// Asks the master. The node must have advertised everything.
  ///
  /// @param node its full name.
  /// @return no value if the master doesn't answer or doesn't know the node.
  static std::optional<Registrations> read(XmlRpcCaller& master, const std::string& node);

  /// Registers all of it again, with a master that has forgotten it. The subscribed topics get the
  /// publishers that have registered meanwhile.
  ///
  /// @param node_uri of the node's own ROS API.
  /// @return whether the master took all of it.
  bool registerAgain(XmlRpcCaller& master, const std::string& node_uri) const;

  std::size_t topics() const { return published_.size() + subscribed_.size(); }
  std::size_t services() const { return services_.size(); }

 private:
  struct Topic {
    std::string name;
    std::string type;
  };
  struct Service {
    std::string name;
    std::string uri;
  };

  bool subscribeAgain(XmlRpcCaller& master, const Topic& topic, const std::string& node_uri) const;

  std::string node_;
  std::vector<Topic> published_;
  std::vector<Topic> subscribed_;
  std::vector<Service> services_;
};

}  // namespace stepdriver::ros_node
