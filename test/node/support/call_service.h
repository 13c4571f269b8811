#pragma once

#include <ros/node_handle.h>

#include <string>

namespace stepdriver::node_test {

/// Calls a service over a persistent connection, as a C++ client of any node should: roscpp's other
/// kind is closed by the server right after the answer, and now and then the client takes that for
/// a failed call before it reads the answer (ros_comm issue 1976).
///
/// @return false where no answer came.
template <typename Service>
bool callService(const std::string& name, Service& call) {
  return ros::NodeHandle().serviceClient<Service>(name, true).call(call);
}

}  // namespace stepdriver::node_test
