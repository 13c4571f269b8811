#include "config/check_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>

#include "message_text.h"
#include "printable.h"
#include "read_axes.h"
#include "read_kinematics.h"
#include "stepdriver_core/error.h"
#include "write_axes.h"

namespace stepdriver::config {
namespace {

// The largest error of a matrix times its inverse: the condition of a matrix that may be used is at
// most 100, and doubles have 1e-16.
constexpr double kInverseError = 1e-9;

/// A map can't have two keys of one name, so this isn't left to the reader.
bool namesDiffer(const std::vector<AxisConfig>& axes, std::vector<ConfigIssue>& issues) {
  bool differ = true;
  const auto check = [&](std::set<std::string>& names, const std::string& key, const char* what,
                         const std::string& name) {
    if (names.insert(name).second) return;
    issues.push_back({key, fmt::format("has {} named \"{}\" twice, but each must have a name of "
                                       "its own",
                                       what, printable(name))});
    differ = false;
  };
  std::set<std::string> names;
  for (const AxisConfig& axis : axes) {
    check(names, "axes", "an axis", axis.name);
    if (axis.twins.empty()) continue;
    std::set<std::string> motors;
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      check(motors, "axes/" + printable(axis.name) + "/motors", "a motor", axis.motorAt(i).motor);
    }
  }
  return differ;
}

bool isInverse(const Matrix& matrix, const Matrix& inverse) {
  const std::size_t size = matrix.size();
  const auto is_square = [size](const Matrix& one) {
    return one.size() == size && std::all_of(one.begin(), one.end(), [size](const auto& row) {
             return row.size() == size;
           });
  };
  if (!is_square(matrix) || !is_square(inverse)) return false;
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t k = 0; k < size; ++k) {
      double sum = i == k ? -1.0 : 0.0;
      for (std::size_t n = 0; n < size; ++n) sum += matrix[i][n] * inverse[n][k];
      if (!(std::abs(sum) <= kInverseError)) return false;
    }
  }
  return true;
}

/// Which axes share motors: each of them has the same Kinematics, which names all of them.
class KinematicsCheck {
 public:
  /// @param read the axes as the reader made them.
  KinematicsCheck(const std::vector<AxisConfig>& axes, bool axes_are_right,
                  std::vector<AxisConfig> read, std::vector<ConfigIssue>& issues)
      : axes_(axes), axes_are_right_(axes_are_right), read_(std::move(read)), issues_(issues) {}

  void check() {
    std::set<const Kinematics*> seen;
    for (const AxisConfig& axis : axes_) {
      if (!axis.kinematics) continue;
      checkMembers(axis);
      if (seen.insert(axis.kinematics.get()).second) checkMatrix(*axis.kinematics);
    }
  }

 private:
  void checkMembers(const AxisConfig& axis) {
    const Kinematics& shared = *axis.kinematics;
    const auto shares = [&](const std::string& name) {
      return std::any_of(axes_.begin(), axes_.end(), [&](const AxisConfig& other) {
        return other.name == name && other.kinematics == axis.kinematics;
      });
    };
    if (shared.numberOf(axis.name) < shared.axes.size() &&
        std::all_of(shared.axes.begin(), shared.axes.end(), shares)) {
      return;
    }
    issues_.push_back(
        {"axes/" + printable(axis.name) + "/kinematics",
         fmt::format("has {}, but must name this axis and others that have the same "
                     "one",
                     shared.axes.empty() ? "no axes" : listText(shared.axes, "and"))});
  }

  void checkMatrix(const Kinematics& shared) {
    const std::size_t before = issues_.size();
    const ConfigValue tree =
        ConfigValue::Map{{"axes", ConfigValue::List(shared.axes.begin(), shared.axes.end())},
                         {"matrix", writeMatrix(shared.matrix)}};
    readKinematics(ConfigReader(tree, "kinematics", issues_), axes_are_right_, read_);
    if (issues_.size() > before || isInverse(shared.matrix, shared.inverse)) return;
    issues_.push_back({"kinematics/inverse", "must be the inverse of the matrix, see inverseOf()"});
  }

  const std::vector<AxisConfig>& axes_;
  const bool axes_are_right_;
  std::vector<AxisConfig> read_;
  std::vector<ConfigIssue>& issues_;
};

}  // namespace

void checkAxes(const std::vector<AxisConfig>& axes, std::vector<ConfigIssue>& issues,
               UsedLines& used) {
  // An example of the library has no axes.
  if (axes.empty() || !namesDiffer(axes, issues)) return;
  const std::size_t before = issues.size();
  const WrittenAxes written = writeAxes(axes);
  std::vector<AxisConfig> read = readAxes(written.axes, "axes", issues, used, written.chips);
  KinematicsCheck(axes, issues.size() == before, std::move(read), issues).check();
}

void checkAxes(const std::vector<AxisConfig>& axes) {
  std::vector<ConfigIssue> issues;
  UsedLines used(issues);
  checkAxes(axes, issues, used);
  if (!issues.empty()) throw ConfigError(std::move(issues));
}

std::vector<std::string> homingWarnings(const std::vector<AxisConfig>& axes) {
  std::vector<std::string> warnings;
  for (const AxisConfig& axis : axes) {
    if (!axis.homing || !axis.brake) continue;
    std::vector<std::string> others;
    for (const AxisConfig& other : axes) {
      const bool together = other.homing && other.homing->order == axis.homing->order;
      if (together && other.name != axis.name) others.push_back(other.name);
    }
    if (others.empty()) continue;
    warnings.push_back(fmt::format(
        "axis {0} has a brake, so it may be vertical, but it is homed together with {1}: each has "
        "the homing/order {2}. If {0} must be out of the way first, give it a lower homing/order",
        axis.name, listText(others, "and"), axis.homing->order));
  }
  return warnings;
}

}  // namespace stepdriver::config
