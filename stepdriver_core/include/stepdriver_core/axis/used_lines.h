#pragma once

#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::axis {

/// The lines of the whole configuration: each may serve one purpose only.
class UsedLines {
 public:
  explicit UsedLines(std::vector<ConfigIssue>& issues) : issues_(issues) {}

  /// @param key full name of the parameter that names the line.
  void add(const std::string& key, const std::string& line);

 private:
  std::vector<ConfigIssue>& issues_;
  std::map<std::string, std::string> users_;  ///< line -> key
};

}  // namespace stepdriver::axis
