#include "options.h"

#include <boost/program_options/value_semantic.hpp>

#include "common/command_line.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

namespace po = boost::program_options;

void readPart(const po::variables_map& values, const std::string& name, double& part) {
  const auto percent = findNumber(
      values, name, [](double number) { return number > 0.0 && number <= 100.0; },
      "a number above 0, and 100 at most");
  if (percent) part = *percent / 100.0;
}

}  // namespace

const char* const kUsage =
    R"(usage: console [--driver NAME] [--slow PERCENT] [--fast PERCENT] [name:=value ...]
       console --wizard [--driver NAME] [--axis NAME] [--config FILE] [--output FILE]
                        [--overwrite]

A screen for the person in front of the machine: it shows the axes of a stepdriver_node, live, and
has keys to enable, jog, step and home them. It runs in any terminal, also over ssh (ssh -t), and
restores the terminal when it ends. Nothing moves when it starts, and a disabled axis never moves.

  SPACE             emergency stop of all axes, at any time
  s, Esc            stop of all axes: they decelerate
  up, down, 1 to 9  choose an axis
  left, right       jog slowly; with shift, or by < and >, fast
  - +               one step
  i                 step size: one step of the motor, 0.1, 1 or 10 mm (or degrees)
  g                 go to a position: type it, then press Enter
  z y               set zero at this position: y confirms it
  e, d              enable, disable
  m, o              motors of all axes on, off
  h, a              home the axis, home all
  p, c              hold all axes, resume
  [ ]               slow down, speed up all motions by 10 %
  n, t              choose the next output, switch it on or off
  r                 recover from faults and an emergency stop; this moves nothing
  ?, q              all keys; quit

A terminal does not report that a key was released. A jog continues while the key repeats, and ends
0.2 s after the last repeat; if the console or the connection dies, it ends after the driver's
jog_timeout.

  --driver NAME     name of the node; default: stepdriver
  --slow PERCENT    slow jog speed, in percent of an axis's highest speed; default: 5
  --fast PERCENT    fast jog speed; default: 50

The wizard guides you through a first bring-up, line by line: do the switches read correctly, which
way is plus, is the distance right? Each move comes after a question, is small and slow, and ends if
you press Enter or any switch changes. The wizard writes a configuration with its findings; the
running node isn't changed.

  --axis NAME       only this axis
  --config FILE     the YAML file that the driver was started with: the wizard writes its text with
                    the changes, and keeps comments and order; default: it writes all parameters
  --output FILE     default: stepdriver_wizard.yaml
  --overwrite       replaces an existing file

Exit codes: 0 ended as asked, 1 no master, no driver, no terminal, or a file that can't be written,
2 the wizard ended before it wrote a file, 64 wrong usage.
)";

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  WizardOptions& wizard = options.wizard_options;
  po::options_description known;
  auto add = known.add_options();
  add("help,h", po::bool_switch(&options.help));
  add("driver", po::value(&options.driver));
  add("slow", po::value<std::string>());
  add("fast", po::value<std::string>());
  add("wizard", po::bool_switch(&options.wizard));
  add("axis", po::value(&wizard.axis));
  add("config", po::value(&wizard.config));
  add("output", po::value(&wizard.output));
  add("overwrite", po::bool_switch(&wizard.overwrite));
  const po::variables_map values = readCommandLine(known, arguments, "driver");
  if (options.help) return options;
  readPart(values, "slow", options.speeds.slow);
  readPart(values, "fast", options.speeds.fast);
  const bool for_wizard =
      values.count("axis") + values.count("config") + values.count("output") > 0 ||
      wizard.overwrite;
  if (for_wizard && !options.wizard) {
    throw Error("--axis, --config, --output and --overwrite need --wizard");
  }
  return options;
}

}  // namespace stepdriver::console
