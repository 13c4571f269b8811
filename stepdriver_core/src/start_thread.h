#pragma once

#include <fmt/format.h>

#include <system_error>
#include <thread>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver {

/// @throw ExhaustedError if the system doesn't start another thread.
template <typename Run>
std::thread startThread(Run&& run) {
  try {
    return std::thread(std::forward<Run>(run));
  } catch (const std::system_error& error) {
    throw ExhaustedError(fmt::format("no thread can be started: {}", error.what()));
  }
}

}  // namespace stepdriver
