#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::config {

/// The lines of the whole configuration: each may serve only one purpose, except ENABLE lines, and
/// those of switches that share one.
class UsedLines {
 public:
  /// @param issues a line with two purposes is reported here; outlives this.
  explicit UsedLines(std::vector<ConfigIssue>& issues) : issues_(issues) {}

  /// @param key full name of the parameter that names the line.
  void add(const std::string& key, const std::string& line);

  /// An ENABLE line, which several axes may share if the same level enables all of them.
  ///
  /// @param on that level; empty if it isn't known.
  void addEnable(const std::string& key, const std::string& line, std::optional<bool> on);

  /// The line of a switch that others may share, if they are active at the same level.
  ///
  /// @param endstop is shared.
  void addShared(const std::string& key, const Endstop& endstop);

  /// Calls this for each line, with the key that has named it first.
  template <typename Use>
  void forEach(const Use& use) const {
    for (const auto& [line, user] : users_) use(line, user.key);
  }

 private:
  struct User {
    std::string key;
    bool enables = false;
    std::optional<bool> on{};
    std::optional<Endstop> shared{};
  };

  void refuse(const std::string& key, const std::string& line, const User& user);

  std::vector<ConfigIssue>& issues_;
  std::map<std::string, User> users_;  ///< the user of each line
};

}  // namespace stepdriver::config
