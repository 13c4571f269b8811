#include "options.h"

#include <boost/program_options/value_semantic.hpp>
#include <cmath>

#include "common/command_line.h"
#include "stepdriver_core/error.h"

namespace stepdriver::check {
namespace {

namespace po = boost::program_options;

BackendChoice backendOf(const std::string& name) {
  if (name == "simulated") return BackendChoice::kSimulated;
  if (name == "libgpiod") return BackendChoice::kLibgpiod;
  throw Error("--backend " + name + ": it must be simulated or libgpiod");
}

}  // namespace

const char* const kUsage =
    R"(usage: stepdriver_check --config FILE [--backend NAME] [--wiring]
                        [--move [--axis NAME] [--distance D]]

Checks whether this computer can drive the axes of a configuration. It shows the GPIO lines and the
programs that hold them, permissions and real-time limits, the duration of a write and the lateness
of the pulse thread, and the step rates that follow from them. It requests the lines at their safe
levels, measures for about half a second and releases them: no edge goes out, ENABLE is never
asserted, and nothing moves without --move. Drivers on a UART are asked which chips they are. It
needs no ROS master. If a node holds the lines, stop it first.

  --config FILE    YAML file with the node's parameters, see config/. Limits of a URDF are ignored
  --backend NAME   libgpiod or simulated, overriding gpio/backend
  --wiring         drivers on a UART: switches the outputs of all of them off by their registers,
                   until the node starts, drives the lines to ENABLE, STEP and DIR to both levels,
                   and asks the chips which of their pins follow. Nothing moves, but a motor that
                   holds a load lets it go
  --move           drives each axis back and forth at its top speed; endstops stop it
  --axis NAME      only this axis
  --distance D     [mm|deg] default: 1 mm or 10 degrees; if negative, the axis moves back first

Exit codes: 0 all good, 1 the configuration is wrong, 2 a line can't be requested, 3 an axis needs a
higher step rate than this computer can sustain, or realtime: enforce would refuse to start, 4 a move
failed or was interrupted, 5 a driver on a UART or a line to it is wrong, 64 wrong usage. If several
apply, the first that was found.
)";

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  po::options_description known;
  auto add = known.add_options();
  add("help,h", po::bool_switch(&options.help));
  add("config", po::value(&options.config));
  add("backend", po::value<std::string>());
  add("wiring", po::bool_switch(&options.wiring));
  add("move", po::bool_switch(&options.move));
  add("axis", po::value(&options.axis));
  add("distance", po::value<std::string>());
  const po::variables_map values = readCommandLine(known, arguments, "config");
  if (options.help) return options;
  if (values.count("backend") > 0) {
    options.backend = backendOf(values["backend"].as<std::string>());
  }
  options.distance = findNumber(
      values, "distance", [](double number) { return std::isfinite(number) && number != 0.0; },
      "a number other than 0");
  if (options.config.empty()) throw Error("--config FILE is missing");
  if (!options.move && (!options.axis.empty() || options.distance)) {
    throw Error("--axis and --distance need --move");
  }
  return options;
}

}  // namespace stepdriver::check
