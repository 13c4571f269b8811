#pragma once

#include <gtest/gtest.h>

#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::test {

// The message of the refusal; empty if the action was accepted.
template <typename Action>
std::string refusal(Action action) {
  try {
    action();
  } catch (const Refused& refused) {
    return refused.what();
  }
  return "";
}

}  // namespace stepdriver::test

#define EXPECT_REFUSED(action, words)                                            \
  do {                                                                           \
    const std::string message = stepdriver::test::refusal([&] { action; });      \
    EXPECT_NE(message.find(words), std::string::npos) << "message: " << message; \
  } while (false)
