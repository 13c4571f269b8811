#include <algorithm>
#include <charconv>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "kernel_trace.h"
#include "stepdriver_core/error.h"
#include "trace_program.h"
#include "waveform.h"

namespace {

using stepdriver::Error;
namespace driver = stepdriver::driver;
namespace kernel = stepdriver::kernel;

constexpr const char kUsage[] =
    "usage: check_waveform TRACE AXIS...\n"
    "\n"
    "Compares what the kernel did to the lines of each axis with the requirements of its driver\n"
    "chip, and prints the result. TRACE is a recording of `run.sh --trace` or gpio_trace.sh.\n"
    "\n"
    "AXIS is --axis NAME, and after it\n"
    "  --driver NAME             a4988, drv8825 or tb6600\n"
    "  --step LINE, --dir LINE   chip:offset, with the chip's label, or the kernel's number\n"
    "  --enable LINE             only if it is wired\n"
    "  --inverted PIN,...        of step, dir and enable: those whose level the wiring inverts\n"
    "  --shortest-interval NS    the shortest planned time from one step to the next\n"
    "  --expect-position N       the expected pulses forward minus pulses backward\n"
    "\n"
    "Exit status: 0 if all is right; 1 after a violation or with another position; 2 if the trace\n"
    "couldn't be checked.\n";

/// An axis, as the arguments describe it.
struct Asked {
  std::string name;
  std::string driver;
  std::string step, dir, enable;
  std::vector<std::string> inverted;
  std::int64_t shortest_interval_ns = 0;
  std::optional<std::int64_t> position;
};

std::int64_t integerOf(const std::string& option, const std::string& text) {
  std::int64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stop != end || text.empty())
    throw Error(option + " " + text + " isn't a whole number.");
  return number;
}

std::vector<std::string> pinsOf(const std::string& text) {
  std::vector<std::string> pins;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    pins.push_back(text.substr(begin, end - begin));
    if (pins.back() != "step" && pins.back() != "dir" && pins.back() != "enable")
      throw Error("--inverted " + text + ": there are step, dir and enable.");
    begin = end + 1;
  }
  return pins;
}

std::vector<Asked> askedFor(const std::vector<std::string>& arguments) {
  std::vector<Asked> axes;
  for (std::size_t i = 1; i < arguments.size(); i += 2) {
    const std::string& option = arguments[i];
    if (i + 1 == arguments.size()) throw Error(option + " needs a value.");
    const std::string& value = arguments[i + 1];
    if (option == "--axis") {
      axes.emplace_back().name = value;
      continue;
    }
    if (axes.empty()) throw Error(option + " stands before the first --axis.");
    Asked& axis = axes.back();
    if (option == "--driver") {
      axis.driver = value;
    } else if (option == "--step") {
      axis.step = value;
    } else if (option == "--dir") {
      axis.dir = value;
    } else if (option == "--enable") {
      axis.enable = value;
    } else if (option == "--inverted") {
      axis.inverted = pinsOf(value);
    } else if (option == "--shortest-interval") {
      axis.shortest_interval_ns = integerOf(option, value);
    } else if (option == "--expect-position") {
      axis.position = integerOf(option, value);
    } else {
      throw Error("unknown option: " + option + ".");
    }
  }
  return axes;
}

kernel::WiredAxis wiredAxis(const Asked& asked, const kernel::KernelTrace& trace) {
  const driver::DriverChip* const driver = driver::findDriverChip(asked.driver);
  if (driver == nullptr) {
    std::string known;
    for (const std::string& name : driver::driverChipNames())
      known += (known.empty() ? "" : ", ") + name;
    throw Error("Axis " + asked.name + ": --driver is \"" + asked.driver + "\"; there are " +
                known + ".");
  }
  if (asked.step.empty() || asked.dir.empty())
    throw Error("Axis " + asked.name + " needs --step and --dir.");
  const auto pin = [&](const std::string& line, const char* name) {
    const auto& inverted = asked.inverted;
    return kernel::WiredPin{trace.line(line),
                            std::find(inverted.begin(), inverted.end(), name) != inverted.end()};
  };
  kernel::WiredAxis axis;
  axis.driver = *driver;
  axis.step = pin(asked.step, "step");
  axis.dir = pin(asked.dir, "dir");
  if (!asked.enable.empty()) axis.enable = pin(asked.enable, "enable");
  axis.shortest_interval_ns = asked.shortest_interval_ns;
  return axis;
}

bool isRight(const Asked& asked, const kernel::KernelTrace& trace) {
  const kernel::Waveform seen = waveformOf(trace, wiredAxis(asked, trace));
  std::printf("%s:\n%s", asked.name.c_str(), reportOf(seen).c_str());
  const bool there = !asked.position || *asked.position == seen.position();
  if (!there) {
    std::printf("  the position should be %lld\n", static_cast<long long>(*asked.position));
  }
  return there && seen.violations.empty();
}

bool areRight(const std::vector<std::string>& arguments, const kernel::KernelTrace& trace) {
  bool right = true;
  for (const Asked& axis : askedFor(arguments)) right = isRight(axis, trace) && right;
  return right;
}

}  // namespace

int main(int argc, char** argv) {
  return kernel::runTraceProgram({"check_waveform", kUsage, areRight}, argc, argv);
}
