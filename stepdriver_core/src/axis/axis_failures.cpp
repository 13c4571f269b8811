#include <array>
#include <cerrno>
#include <utility>

#include "axis_impl.h"
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

std::string Axis::Impl::failureText(const pulse::LineFailure& failure) const {
  const AxisLines& own = axis_lines;
  const std::array<std::pair<int, const char*>, 3> inputs{{{own.endstop_min, "min endstop's"},
                                                           {own.endstop_max, "max endstop's"},
                                                           {own.fault, "fault"}}};
  const std::array<std::pair<int, const char*>, 8> outputs{{{own.step, "STEP"},
                                                            {own.dir, "DIR"},
                                                            {own.enable, "ENABLE"},
                                                            {own.sleep, "SLEEP"},
                                                            {own.reset, "RESET"},
                                                            {own.mode[0], "microstep"},
                                                            {own.mode[1], "microstep"},
                                                            {own.mode[2], "microstep"}}};
  const std::string which = failure.input
                                ? "the " + std::string(roleOf(failure.line, inputs)) + " line " +
                                      lines.inputName(failure.line) + " can't be read: "
                                : "the " + std::string(roleOf(failure.line, outputs)) + " line " +
                                      lines.outputName(failure.line) + " can't be written: ";
  return which + gpio::errorText(failure.error) + "; " + remedyFor(failure.error);
}

int Axis::Impl::readInput(int line) const {
  const int level = lines.read(line);
  if (level < 0) throw GpioError(config.name + ": " + failureText({-level, line, true}));
  return level;
}

}  // namespace stepdriver::axis
