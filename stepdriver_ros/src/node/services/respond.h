#pragma once

#include <exception>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

/// Answers a service call: whatever the core throws becomes `success: false` and a message.
///
/// @param action sets what else is in the response, and success where it isn't simply true.
/// @return true: the call is answered; roscpp would tell the client nothing more of a false.
template <typename Response, typename Action>
bool respond(Response& response, const Action& action) {
  try {
    response.success = true;
    action();
  } catch (const std::exception& error) {
    response.success = false;
    response.message = error.what();
  }
  return true;
}

}  // namespace stepdriver::ros_node
