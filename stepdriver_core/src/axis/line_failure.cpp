#include "line_failure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <utility>
#include <vector>

#include "gpio/chip_table.h"

namespace stepdriver::axis {
namespace {

/// What has happened, and what to do about it.
std::string causeOf(const pulse::LineFailure& failure, const LineNames& names) {
  std::string known = names.failure ? names.failure(failure.input, failure.line) : "";
  if (!known.empty()) return known;
  return fmt::format("{}; {}", gpio::errorText(failure.error),
                     failure.error == ENODEV ? "plug it in and start the node again"
                                             : "check the cable and the supply of its chip");
}

using Roles = std::vector<std::pair<int, const char*>>;

Roles inputRoles(const motor::ChipLines& own) {
  return {{own.endstop_min, "min endstop's"},
          {own.endstop_max, "max endstop's"},
          {own.fault, "fault"},
          {own.in_position, "in-position"}};
}

Roles outputRoles(const motor::ChipLines& own, bool cw_ccw) {
  return {{own.step, cw_ccw ? "CW" : "STEP"},
          {own.dir, cw_ccw ? "CCW" : "DIR"},
          {own.enable, "ENABLE"},
          {own.sleep, "SLEEP"},
          {own.reset, "RESET"},
          {own.mode[0], "microstep"},
          {own.mode[1], "microstep"},
          {own.mode[2], "microstep"},
          {own.coils[0], "IN1"},
          {own.coils[1], "IN2"},
          {own.coils[2], "IN3"},
          {own.coils[3], "IN4"}};
}

/// What a line of an axis is for, and of which motor if there are several.
std::pair<std::string, std::string> roleOf(const pulse::LineFailure& failure,
                                           const config::AxisConfig& axis,
                                           const motor::MotorLines& own) {
  if (!failure.input && failure.line == own.brake) return {"brake", ""};
  for (std::size_t i = 0; i < own.motors(); ++i) {
    const motor::ChipLines& lines = own.motorAt(i);
    for (const auto& [line, role] :
         failure.input ? inputRoles(lines) : outputRoles(lines, own.cw_ccw)) {
      if (line != failure.line) continue;
      const std::string& name = axis.motorAt(i).motor;
      return {role, name.empty() ? "" : " of motor " + name};
    }
  }
  return {"GPIO", ""};
}

}  // namespace

bool isLineOf(const pulse::LineFailure& failure, const motor::MotorLines& own) {
  if (!failure.input && failure.line == own.brake) return true;
  for (std::size_t i = 0; i < own.motors(); ++i) {
    const motor::ChipLines& lines = own.motorAt(i);
    const Roles roles = failure.input ? inputRoles(lines) : outputRoles(lines, own.cw_ccw);
    const bool is_its = std::any_of(roles.begin(), roles.end(),
                                    [&](const auto& role) { return role.first == failure.line; });
    if (is_its) return true;
  }
  return false;
}

std::string lineFailureText(const pulse::LineFailure& failure, const config::AxisConfig& axis,
                            const motor::MotorLines& own, const LineNames& names) {
  const std::string& line_name =
      failure.input ? names.input(failure.line) : names.output(failure.line);
  const auto [role, of_motor] = roleOf(failure, axis, own);
  return fmt::format("the {} line {}{} can't be {}: {}", role, line_name, of_motor,
                     failure.input ? "read" : "written", causeOf(failure, names));
}

}  // namespace stepdriver::axis
