#pragma once

#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/axis/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::axis {

/// What a number may be; bounds included unless said otherwise.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_excluded = false;

  static Range positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
  static Range notNegative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }
};

/// Reads one map of a configuration strictly: the types are exact (an int is taken where a double
/// is wanted, nothing else is converted), numbers are finite, unknown keys are errors. It collects
/// every issue, under the full name of the parameter, and never throws on what it reads.
///
/// A reader that found something wrong returns the default; whoever reads looks at the issues
/// before using anything.
class ConfigReader {
 public:
  /// @param value the map; where it isn't one, that is the first issue.
  /// @param name full name of the map, as `/stepdriver/axes/x`.
  /// @param issues where issues go; outlives the reader.
  ConfigReader(const ConfigValue& value, std::string name, std::vector<ConfigIssue>& issues);

  bool has(const std::string& key) const;
  std::string fullName(const std::string& key) const { return name_ + "/" + key; }

  // With a default the key may be missing; without, that is an issue.
  double number(const std::string& key, const Range& range, std::optional<double> fallback = {});
  int integer(const std::string& key, int min, int max, std::optional<int> fallback = {});
  bool boolean(const std::string& key, std::optional<bool> fallback = {});
  std::string text(const std::string& key, std::optional<std::string> fallback = {});
  std::string oneOf(const std::string& key, const std::vector<std::string>& allowed,
                    std::optional<std::string> fallback = {});
  /// A map below this one; an empty one where the key is missing.
  ConfigReader map(const std::string& key);

  void issue(const std::string& key, const std::string& message);

  /// Reports every key of the map that nothing has asked for, with the nearest known one.
  void rejectUnknown();

 private:
  const ConfigValue* find(const std::string& key);

  std::string name_;
  const ConfigValue::Map* map_;
  std::vector<ConfigIssue>& issues_;
  std::set<std::string> known_;
};

/// Reads the map of axes, in the schema that README.md shows.
///
/// @param name full name of the map, as `/stepdriver/axes`.
/// @param issues everything that is wrong is added here.
/// @return the axes in the order of their names; to be used only where no issue was added.
std::vector<AxisConfig> readAxes(const ConfigValue& axes, const std::string& name,
                                 std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::axis
