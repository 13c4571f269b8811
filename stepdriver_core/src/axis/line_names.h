#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stepdriver::axis {

/// The lines of a machine as messages name them, by their index in the request.
struct LineNames {
  std::vector<std::string> outputs;
  std::vector<std::string> inputs;

  const std::string& output(int line) const { return outputs.at(static_cast<std::size_t>(line)); }
  const std::string& input(int line) const { return inputs.at(static_cast<std::size_t>(line)); }
};

}  // namespace stepdriver::axis
