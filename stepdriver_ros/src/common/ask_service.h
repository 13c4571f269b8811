#pragma once

#include <ros/node_handle.h>
#include <ros/service_client.h>

#include <string>

#include "background_call.h"

namespace stepdriver::client {

constexpr const char* kNobodyAnswers = "nobody answers";

/// @param client persistent: otherwise roscpp may report a failure although the call was carried
///   out.
template <typename Service>
Answer ask(ros::ServiceClient& client, const typename Service::Request& request = {}) {
  Service call;
  call.request = request;
  if (!client.call(call)) return {false, kNobodyAnswers};
  return {call.response.success != 0, call.response.message};
}

/// The whole answer, over a connection for this one call. If nobody answers, `success` is false,
/// and `message` says so.
///
/// @param service its full name.
template <typename Service>
typename Service::Response respondedBy(const std::string& service,
                                       const typename Service::Request& request) {
  ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(service, true);
  Service call;
  call.request = request;
  if (!client.call(call)) {
    call.response.success = 0;
    call.response.message = kNobodyAnswers;
  }
  return call.response;
}

/// The same, with a connection for this one call.
///
/// @param service its full name.
template <typename Service>
Answer askService(const std::string& service, const typename Service::Request& request = {}) {
  ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(service, true);
  return ask<Service>(client, request);
}

}  // namespace stepdriver::client
