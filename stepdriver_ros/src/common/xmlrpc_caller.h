#pragma once

#include <xmlrpcpp/XmlRpcClient.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace stepdriver::ros_node {

/// How long a call waits for the ROS master.
constexpr std::chrono::milliseconds kMasterPatience{1000};

/// Calls the ROS API of a master or a node, over one connection that is kept, from one thread.
/// No call takes much longer than the patience. ros::master::execute() waits for ever if a master
/// accepts the connection and never answers.
class XmlRpcCaller : private XmlRpc::XmlRpcClient {
 public:
  XmlRpcCaller(const std::string& host, std::uint32_t port, std::chrono::milliseconds patience);

  std::chrono::milliseconds patience() const { return patience_; }

  struct Answer {
    int code = 0;  ///< 1: success, 0: failed, -1: refused
    std::string text;
    XmlRpc::XmlRpcValue value;
  };

  /// @return no value if no answer came that the ROS API allows.
  template <typename... Arguments>
  std::optional<Answer> call(const char* method, const Arguments&... arguments) {
    XmlRpc::XmlRpcValue all;
    int i = 0;
    ((all[i++] = XmlRpc::XmlRpcValue(arguments)), ...);
    return callWith(method, all);
  }

 private:
  std::optional<Answer> callWith(const char* method, const XmlRpc::XmlRpcValue& arguments);
  bool doConnect() override;

  const std::chrono::milliseconds patience_;
};

}  // namespace stepdriver::ros_node
