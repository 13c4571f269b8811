#pragma once

#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "kernel_trace.h"

namespace stepdriver::kernel {

/// A program whose first argument is the file of a kernel's trace, and which needs at least two
/// more arguments.
struct TraceProgram {
  const char* name;
  const char* usage;
  /// Handles all arguments.
  /// @return whether all is right.
  std::function<bool(const std::vector<std::string>& arguments, const KernelTrace& trace)> act;
};

/// The program's main().
/// @return 0 if all is right, 1 if not, 2 if the check wasn't possible.
inline int runTraceProgram(const TraceProgram& program, int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() == 1 && (arguments[0] == "--help" || arguments[0] == "-h")) {
    std::fputs(program.usage, stdout);
    return 0;
  }
  if (arguments.size() < 3) {
    std::fputs(program.usage, stderr);
    return 2;
  }
  try {
    return program.act(arguments, KernelTrace::fromFile(arguments[0])) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", program.name, error.what());
    return 2;
  }
}

}  // namespace stepdriver::kernel
