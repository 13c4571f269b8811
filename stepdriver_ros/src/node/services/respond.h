#pragma once

#include <exception>

#include "node/refusal_log.h"

namespace stepdriver::ros_node {

/// Answers a service call: exceptions of the core become `success: false` and a message,
/// which is logged.
///
/// @param action sets the other fields of the response, and success if it isn't simply true.
/// @return true, because the call is answered: with false, roscpp would tell the client nothing
/// else.
template <typename Response, typename Action>
bool respond(Response& response, const Action& action) {
  try {
    response.success = true;
    action();
  } catch (const std::exception& error) {
    response.success = false;
    response.message = error.what();
    logRefusal(response.message);
  }
  return true;
}

}  // namespace stepdriver::ros_node
