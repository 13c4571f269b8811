#pragma once

#include <fstream>
#include <ios>
#include <iterator>
#include <string>

namespace stepdriver::test {

/// The contents of a file; empty if it can't be read.
inline std::string contentsOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace stepdriver::test
