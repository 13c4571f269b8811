#pragma once

#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/service.h>

#include <string>

#include "support/wait.h"

namespace stepdriver::node_test {

/// Calls a service over a persistent connection, as every C++ client of a node should. The server
/// closes roscpp's other kind of connection right after the answer, and now and then the client
/// takes that for a failed call before it reads the answer (ros_comm issue 1976).
///
/// @return false if no answer came.
template <typename Service>
bool callService(const std::string& name, Service& call) {
  return ros::NodeHandle().serviceClient<Service>(name, true).call(call);
}

/// Calls a service of a node that may still be starting; the test fails if no answer comes.
template <typename Service>
typename Service::Response callWhenThere(const std::string& name,
                                         const typename Service::Request& request = {}) {
  EXPECT_TRUE(ros::service::waitForService(name, ros::Duration(kBound.count())));
  Service call;
  call.request = request;
  EXPECT_TRUE(callService(name, call)) << name << " doesn't answer";
  return call.response;
}

}  // namespace stepdriver::node_test
