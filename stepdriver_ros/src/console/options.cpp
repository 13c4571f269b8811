#include "options.h"

#include <cmath>
#include <cstdlib>

#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

double partOf(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const double percent = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(percent > 0.0 && percent <= 100.0)) {
    throw Error(option + " " + text + ": it must be a number above 0, and 100 at most");
  }
  return percent / 100.0;
}

}  // namespace

const char* const kUsage =
    R"(usage: console [--driver NAME] [--slow PERCENT] [--fast PERCENT] [name:=value ...]
       console --wizard [--driver NAME] [--axis NAME] [--output FILE] [--overwrite]

A screen for whoever stands in front of a machine: the axes of a stepdriver_node, live, and keys to
enable, jog, step and home them. It runs in any terminal, over ssh too (ssh -t), and gives it back
as it was. Nothing moves when it starts, and nothing ever that isn't enabled.

  SPACE             emergency stop of all axes, at any time
  s, Esc            stop of all axes: they decelerate
  up, down, 1 to 9  choose an axis
  left, right       jog slowly; with shift, or by < and >, fast
  - +               one step of the motor
  e, d              enable, disable
  h, a              home the axis, home all
  r                 recover from faults and an emergency stop; nothing moves by that
  ?, q              all keys; quit

A terminal tells of no key that is let go. A jog goes on while the key repeats, and ends 0.2 s after
the last repeat; where the console or the connection dies, after the driver's jog_timeout.

  --driver NAME     of the node; default: stepdriver
  --slow PERCENT    of an axis's highest speed to jog at; default: 5
  --fast PERCENT    default: 50

The wizard is a first bring-up, line by line: do the switches read right, which way is plus, is the
distance right? Each move comes after a question, is small and slow, and is stopped by Enter and by
any switch that changes. It writes a configuration with what it has found; what runs isn't changed.

  --axis NAME       that axis only
  --output FILE     default: stepdriver_wizard.yaml
  --overwrite       replaces a file that is there

Exit codes: 0 ended as asked, 1 no master, no driver, no terminal, or a file that can't be written,
2 the wizard was ended before it wrote a file, 64 wrong usage.
)";

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  std::string for_wizard;
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
    if (name == "--driver") {
      options.driver = value();
    } else if (name == "--slow") {
      options.speeds.slow = partOf(name, value());
    } else if (name == "--fast") {
      options.speeds.fast = partOf(name, value());
    } else if (name == "--wizard") {
      options.wizard = true;
    } else if (name == "--axis") {
      options.wizard_options.axis = for_wizard = value();
    } else if (name == "--output") {
      options.wizard_options.output = for_wizard = value();
    } else if (name == "--overwrite") {
      options.wizard_options.overwrite = true;
      for_wizard = name;
    } else {
      throw Error(name + " isn't known");
    }
  }
  if (!options.wizard && !for_wizard.empty()) {
    throw Error("--axis, --output and --overwrite go with --wizard");
  }
  return options;
}

}  // namespace stepdriver::console
