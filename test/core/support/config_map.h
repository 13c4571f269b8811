#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::config {

inline ConfigValue::Map mapOf(std::initializer_list<ConfigValue::Map::value_type> entries) {
  return ConfigValue::Map(entries);
}

/// The map that contains the last part of a path such as `x/pins/step`; created if it is missing.
inline ConfigValue::Map& mapAt(ConfigValue& root, const std::string& path, std::string& last) {
  ConfigValue* at = &root;
  std::string::size_type begin = 0;
  for (auto end = path.find('/'); end != std::string::npos; end = path.find('/', begin)) {
    if (at->as<ConfigValue::Map>() == nullptr) *at = ConfigValue::Map{};
    at = &(*at->as<ConfigValue::Map>())[path.substr(begin, end - begin)];
    begin = end + 1;
  }
  if (at->as<ConfigValue::Map>() == nullptr) *at = ConfigValue::Map{};
  last = path.substr(begin);
  return *at->as<ConfigValue::Map>();
}

inline void put(ConfigValue& root, const std::string& path, ConfigValue value) {
  std::string last;
  mapAt(root, path, last)[last] = std::move(value);
}

inline void drop(ConfigValue& root, const std::string& path) {
  std::string last;
  mapAt(root, path, last).erase(last);
}

using Lines = std::vector<std::string>;

/// The issues as lines `key: message`.
inline Lines linesOf(const std::vector<ConfigIssue>& issues) {
  std::vector<std::string> lines;
  lines.reserve(issues.size());
  for (const ConfigIssue& issue : issues) lines.push_back(issue.key + ": " + issue.message);
  return lines;
}

}  // namespace stepdriver::config
