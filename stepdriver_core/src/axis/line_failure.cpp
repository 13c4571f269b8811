#include "line_failure.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <utility>

#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::axis {
namespace {

std::string remedyFor(int error) {
  return error == ENODEV ? "plug it in and start the node again"
                         : "check the cable and the supply of its chip";
}

/// What the line of an index is for.
template <std::size_t kCount>
const char* roleOf(int line, const std::array<std::pair<int, const char*>, kCount>& roles) {
  for (const auto& [index, role] : roles) {
    if (index == line) return role;
  }
  return "GPIO";
}

}  // namespace

std::string lineFailureText(const pulse::LineFailure& failure, const motor::MotorLines& own,
                            const LineNames& names) {
  const std::array<std::pair<int, const char*>, 4> input_roles{{{own.endstop_min, "min endstop's"},
                                                                {own.endstop_max, "max endstop's"},
                                                                {own.fault, "fault"},
                                                                {own.in_position, "in-position"}}};
  const std::array<std::pair<int, const char*>, 9> output_roles{
      {{own.step, own.cw_ccw ? "CW" : "STEP"},
       {own.dir, own.cw_ccw ? "CCW" : "DIR"},
       {own.enable, "ENABLE"},
       {own.sleep, "SLEEP"},
       {own.reset, "RESET"},
       {own.brake, "brake"},
       {own.mode[0], "microstep"},
       {own.mode[1], "microstep"},
       {own.mode[2], "microstep"}}};
  const char* role =
      failure.input ? roleOf(failure.line, input_roles) : roleOf(failure.line, output_roles);
  const std::string& line_name =
      failure.input ? names.input(failure.line) : names.output(failure.line);
  return fmt::format("the {} line {} can't be {}: {}; {}", role, line_name,
                     failure.input ? "read" : "written", gpio::errorText(failure.error),
                     remedyFor(failure.error));
}

}  // namespace stepdriver::axis
