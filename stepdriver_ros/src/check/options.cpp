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
    R"(usage: stepdriver_check --config FILE [--backend NAME]
                        [--move [--axis NAME] [--distance D]]

Says whether this machine can drive the axes of a configuration: its GPIO lines and who holds
them, rights and real-time limits, what a write costs and how late the pulse thread wakes, and the
step rates that follow. It takes the lines at their safe levels, measures for about half a second
and releases them: no edge goes out, ENABLE is never asserted, and nothing moves without --move.
Needs no ROS master; a node that holds the lines must be ended first.

  --config FILE    YAML as the node's parameters, see config/. Limits of a URDF aren't in it
  --backend NAME   libgpiod or simulated, whatever gpio/backend says
  --move           drives each axis forth and back at its top speed. Endstops stop it
  --axis NAME      that axis only
  --distance D     [mm|deg] 1 mm or 10 degrees by default; where negative, back comes first

Exit codes: 0 all good, 1 the configuration is wrong, 2 a line can't be had, 3 an axis asks for
more than this machine holds, or realtime: enforce would refuse, 4 a move failed or was
interrupted, 64 wrong usage. Of several the lowest.
)";

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  po::options_description known;
  auto add = known.add_options();
  add("help,h", po::bool_switch(&options.help));
  add("config", po::value(&options.config));
  add("backend", po::value<std::string>());
  add("move", po::bool_switch(&options.move));
  add("axis", po::value(&options.axis));
  add("distance", po::value<std::string>());
  const po::variables_map values = readCommandLine(known, arguments);
  if (options.help) return options;
  if (values.count("backend") > 0) {
    options.backend = backendOf(values["backend"].as<std::string>());
  }
  options.distance = findNumber(
      values, "distance", [](double number) { return std::isfinite(number) && number != 0.0; },
      "a number, and not 0");
  if (options.config.empty()) throw Error("--config FILE is missing");
  if (!options.move && (!options.axis.empty() || options.distance)) {
    throw Error("--axis and --distance go with --move");
  }
  return options;
}

}  // namespace stepdriver::check
