#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace stepdriver::test {

/// The lines of a board that identifies them by name.
class LineNames {
 public:
  int indexOf(const std::string& line) {
    const auto known = std::find(names_.begin(), names_.end(), line);
    const auto index = static_cast<int>(known - names_.begin());
    if (known == names_.end()) names_.push_back(line);
    return index;
  }

  const std::string& operator[](int index) const {
    return names_.at(static_cast<std::size_t>(index));
  }

 private:
  std::vector<std::string> names_;
};

}  // namespace stepdriver::test
