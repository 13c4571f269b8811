#pragma once

#include <cstdlib>
#include <string>

namespace stepdriver::test {

/// How often a random test runs.
///
/// @param variable of the environment that says it, for long runs by hand.
inline int runsOf(const char* variable, int usual) {
  const char* const wanted = std::getenv(variable);
  return wanted != nullptr ? std::stoi(wanted) : usual;
}

}  // namespace stepdriver::test
