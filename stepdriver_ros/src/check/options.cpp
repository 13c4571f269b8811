#include "options.h"

#include <cmath>
#include <cstdlib>

#include "stepdriver_core/error.h"

namespace stepdriver::check {
namespace {

BackendChoice backendOf(const std::string& name) {
  if (name == "simulated") return BackendChoice::kSimulated;
  if (name == "libgpiod") return BackendChoice::kLibgpiod;
  throw Error("--backend " + name + ": it must be simulated or libgpiod");
}

double distanceOf(const std::string& text) {
  char* end = nullptr;
  const double distance = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(distance) || distance == 0.0) {
    throw Error("--distance " + text + ": it must be a number, and not 0");
  }
  return distance;
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
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    const auto value = [&] {
      if (i + 1 == arguments.size()) throw Error(name + " needs a value");
      return arguments[++i];
    };
    if (name == "--help" || name == "-h") {
      options.help = true;
      return options;
    }
    if (name == "--config") {
      options.config = value();
    } else if (name == "--backend") {
      options.backend = backendOf(value());
    } else if (name == "--move") {
      options.move = true;
    } else if (name == "--axis") {
      options.axis = value();
    } else if (name == "--distance") {
      options.distance = distanceOf(value());
    } else {
      throw Error(name + " isn't known");
    }
  }
  if (options.config.empty()) throw Error("--config FILE is missing");
  if (!options.move && (!options.axis.empty() || options.distance)) {
    throw Error("--axis and --distance go with --move");
  }
  return options;
}

}  // namespace stepdriver::check
