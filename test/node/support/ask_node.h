#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <cstdint>
#include <string>

namespace stepdriver::node_test {

/// The port of a node's own interface, according to the master. The test fails if it knows no such
/// node.
std::uint16_t xmlRpcPort(const std::string& node);

/// Calls a method of a node's own interface, which isn't a service: `getPid`, `shutdown`. The test
/// fails if no answer comes.
///
/// @param why the reason for `shutdown`; other methods ignore it.
/// @return the answer's value.
XmlRpc::XmlRpcValue askNode(const std::string& node, const std::string& method,
                            const std::string& why = {});

}  // namespace stepdriver::node_test
