#pragma once

#include <ros/console.h>

#include <algorithm>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"

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

/// For homings that nobody waits for.
inline void logHoming(const std::vector<axis::HomingResult>& results) {
  if (areAllHomed(results)) {
    ROS_INFO_NAMED("homing", "%s", messageOf(results).c_str());
  } else {
    ROS_WARN_NAMED("homing", "%s", messageOf(results).c_str());
  }
}

}  // namespace stepdriver::ros_node
