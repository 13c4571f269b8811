#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::ros_node {

inline bool areAllHomed(const std::vector<axis::HomingResult>& results) {
  return std::all_of(results.begin(), results.end(), [](const axis::HomingResult& result) {
    return result.end == axis::HomingEnd::kHomed;
  });
}

/// How each of them ended, in words.
inline std::string messageOf(const std::vector<axis::HomingResult>& results) {
  std::string text;
  for (const axis::HomingResult& result : results) {
    text += (text.empty() ? "" : "; ") + result.message;
  }
  return text;
}

}  // namespace stepdriver::ros_node
