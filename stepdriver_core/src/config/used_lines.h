#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::config {

/// The lines of the whole configuration: each may serve one purpose only, but ENABLE lines.
class UsedLines {
 public:
  /// @param issues where a line with two purposes is told of; outlives this.
  explicit UsedLines(std::vector<ConfigIssue>& issues) : issues_(issues) {}

  /// @param key full name of the parameter that names the line.
  void add(const std::string& key, const std::string& line);

  /// An ENABLE line, which several axes may share where all of them are enabled by one level.
  ///
  /// @param on that level; none where it isn't known.
  void addEnable(const std::string& key, const std::string& line, std::optional<bool> on);

 private:
  struct User {
    std::string key;
    bool enables = false;
    std::optional<bool> on{};
  };

  void refuse(const std::string& key, const std::string& line, const User& user);

  std::vector<ConfigIssue>& issues_;
  std::map<std::string, User> users_;  ///< by line
};

}  // namespace stepdriver::config
