#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace stepdriver::axis {

/// The lines of a machine as messages name them, by their index in the request.
struct LineNames {
  std::vector<std::string> outputs;
  std::vector<std::string> inputs;
  /// gpio::Lines::failureText() of the machine's lines; empty: there is none.
  std::function<std::string(bool input, int line)> failure;

  const std::string& output(int line) const { return outputs.at(static_cast<std::size_t>(line)); }
  const std::string& input(int line) const { return inputs.at(static_cast<std::size_t>(line)); }
};

}  // namespace stepdriver::axis
