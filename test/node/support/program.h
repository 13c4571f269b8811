#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/node_process.h"
#include "support/wait.h"

namespace stepdriver::node_test {

struct ProgramEnd {
  int code = -1;
  std::string output;  ///< what it wrote to both streams
};

/// Runs one of the package's programs to its end, as `rosrun stepdriver NAME` does.
inline ProgramEnd runProgram(const std::string& name, const std::vector<std::string>& arguments) {
  NodeProcess process(arguments, std::string(STEPDRIVER_PROGRAMS) + "/" + name);
  // Time for Python, matplotlib and a new font cache, on a busy machine.
  const auto code = process.waitForExit(2 * kBound);
  EXPECT_TRUE(code) << name << " doesn't end";
  return {code.value_or(-1), process.output()};
}

}  // namespace stepdriver::node_test
