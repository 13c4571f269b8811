#include <string>
#include <vector>

#include "kernel_trace.h"
#include "sim/vcd_trace.h"
#include "stepdriver_core/error.h"
#include "trace_program.h"

namespace {

constexpr const char kUsage[] =
    "usage: trace_to_vcd TRACE VCD AXIS.PIN=LINE...\n"
    "\n"
    "Writes what the kernel did to its GPIO lines (TRACE: a recording of `run.sh --trace` or\n"
    "gpio_trace.sh) to a VCD file, in the form of the simulated rig's trace.\n"
    "\n"
    "AXIS.PIN  scope and variable in the VCD file: x.step\n"
    "LINE      chip:offset, with the chip's label, or the kernel's number of the line\n"
    "\n"
    "Time 0 is the first event of any of these lines. Times are those at which the kernel called\n"
    "the chip's driver, in nanoseconds.\n"
    "\n"
    "Exit status: 0; 2 if the file couldn't be written.\n";

stepdriver::kernel::TracedPin tracedPin(const std::string& text,
                                        const stepdriver::kernel::KernelTrace& trace) {
  const std::size_t equals = text.find('=');
  const std::size_t point = text.rfind('.', equals);
  if (equals == std::string::npos || point == std::string::npos || point == 0 ||
      point + 1 == equals)
    throw stepdriver::Error(text + " isn't AXIS.PIN=LINE.");
  return {{text.substr(0, point), text.substr(point + 1, equals - point - 1)},
          trace.line(text.substr(equals + 1))};
}

bool convert(const std::vector<std::string>& arguments,
             const stepdriver::kernel::KernelTrace& trace) {
  std::vector<stepdriver::kernel::TracedPin> pins;
  for (std::size_t i = 2; i < arguments.size(); ++i) pins.push_back(tracedPin(arguments[i], trace));
  stepdriver::sim::VcdTrace vcd(arguments[1]);
  copyTo(vcd, trace, pins);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  return stepdriver::kernel::runTraceProgram({"trace_to_vcd", kUsage, convert}, argc, argv);
}
