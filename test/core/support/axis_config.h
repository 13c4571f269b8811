#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "config/config_reader.h"
#include "support/config_map.h"

namespace stepdriver::config {

/// The minimum that a linear axis needs.
inline ConfigValue linearAxis(const std::string& chip = "gpiochip0") {
  return mapOf({{"driver", "a4988"},
                {"pins", mapOf({{"step", chip + ":17"}, {"dir", chip + ":27"}})},
                {"microsteps", 16},
                {"steps_per_mm", 80.0},
                {"max_speed_mm_s", 100.0},
                {"acceleration_mm_s2", 500.0}});
}

inline ConfigValue rotaryAxis(const std::string& chip = "gpiochip0") {
  return mapOf({{"driver", "drv8825"},
                {"pins", mapOf({{"step", chip + ":17"}, {"dir", chip + ":27"}})},
                {"microsteps", 32},
                {"steps_per_degree", 10.0},
                {"max_speed_deg_s", 180.0},
                {"acceleration_deg_s2", 360.0}});
}

inline ConfigValue tb6600Axis() {
  ConfigValue axis = linearAxis();
  put(axis, "driver", "tb6600");
  return axis;
}

inline Lines issuesOf(const ConfigValue& axes) {
  std::vector<ConfigIssue> issues;
  config::readAxes(axes, "/axes", issues);
  return linesOf(issues);
}

inline Lines issuesOfX(const ConfigValue& axis) { return issuesOf(mapOf({{"x", axis}})); }

/// Reads an axis that must be valid.
inline AxisConfig readX(const ConfigValue& axis) {
  std::vector<ConfigIssue> issues;
  const auto configs = config::readAxes(mapOf({{"x", axis}}), "/axes", issues);
  EXPECT_EQ(linesOf(issues), Lines{});
  return configs.empty() ? AxisConfig{} : configs.front();
}

/// The only issue of an axis x.
inline Lines lineOfX(const std::string& path, const std::string& message) {
  return {"/axes/x/" + path + ": " + message};
}

/// A change of a valid axis, and the only issue that it causes; an empty message means no issue.
struct Change {
  std::string path;
  ConfigValue value;
  std::string message;
};

inline void expectIssues(const ConfigValue& good, const std::vector<Change>& changes) {
  ASSERT_EQ(issuesOfX(good), Lines{});
  for (const Change& change : changes) {
    ConfigValue axis = good;
    put(axis, change.path, change.value);
    EXPECT_EQ(issuesOfX(axis),
              change.message.empty() ? Lines{} : lineOfX(change.path, change.message))
        << change.path << " = " << change.value.shown();
  }
}

inline void expectMissing(const ConfigValue& good,
                          const std::vector<std::pair<std::string, std::string>>& keys) {
  for (const auto& [key, message] : keys) {
    ConfigValue axis = good;
    drop(axis, key);
    EXPECT_EQ(issuesOfX(axis), lineOfX(key, "is missing; it must be " + message));
  }
}

}  // namespace stepdriver::config
