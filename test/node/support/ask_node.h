#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <string>

namespace stepdriver::node_test {

/// Calls a method of a node's own interface, in addition to its services: `getPid`, `shutdown`. The
/// test fails if no answer comes.
///
/// @param why what `shutdown` is told; others take no notice of it.
/// @return the answer's value.
XmlRpc::XmlRpcValue askNode(const std::string& node, const std::string& method,
                            const std::string& why = {});

}  // namespace stepdriver::node_test
