#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "configuration.h"
#include "drivers_report.h"
#include "interrupt_watch.h"
#include "lines_report.h"
#include "move.h"
#include "options.h"
#include "rates_report.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/machine/step_rates.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/hardware.h"
#include "system_report.h"

namespace stepdriver::check {
namespace {

constexpr int kExitGood = 0;
constexpr int kExitConfig = 1;
constexpr int kExitLines = 2;
constexpr int kExitRates = 3;
constexpr int kExitMove = 4;
constexpr int kExitDrivers = 5;
constexpr int kExitUsage = 64;

constexpr std::chrono::seconds kWarning{2};

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

void section(const std::string& title, const std::string& text) {
  print(fmt::format("{}\n{}\n", title, text));
}

/// The sections of the program. It remembers the worst result.
class Check {
 public:
  Check(Options options, ros_node::NodeConfig config)
      : options_(std::move(options)),
        config_(std::move(config)),
        real_(config_.backend == setup::GpioBackend::kLibgpiod) {}

  int run() {
    section("Configuration: " + options_.config, configurationText(config_));
    if (real_ && !config_.boards.empty()) return reportBoards();
    reportLines();
    reportDrivers();
    const SystemFacts facts = systemFacts();
    section("Permissions", permissionsText(facts));
    measure();
    section("Real time", limitsText(facts, capability_.rights));
    section("Measured here and now", measurementsText(config_.axes, capability_));
    reportRates();
    if (options_.move) move();
    print(fmt::format("{}: {}\n", exit_code_ == kExitGood ? "Good" : "NOT GOOD", verdict_));
    return exit_code_;
  }

 private:
  void note(int exit_code, const std::string& verdict) {
    if (exit_code_ != kExitGood) return;
    exit_code_ = exit_code;
    verdict_ = verdict;
  }

  // They play the pulses: what this computer can sustain doesn't matter.
  int reportBoards() {
    const auto findings = setup::checkBoards(config_.boards);
    section("Boards", driversText(findings));
    const bool are_right =
        std::all_of(findings.begin(), findings.end(),
                    [](const setup::DriverFinding& finding) { return finding.is_right; });
    verdict_ = "every board answers; its lines are checked when the node starts.";
    if (!are_right) note(kExitLines, "a board can't be used (see above).");
    if (options_.move || options_.wiring) {
      note(kExitUsage, "--move and --wiring don't work with boards, so nothing was moved.");
    }
    print(fmt::format("{}: {}\n", exit_code_ == kExitGood ? "Good" : "NOT GOOD", verdict_));
    return exit_code_;
  }

  void reportLines() {
    const std::string version = gpio::libgpiodVersion();
    const std::string title =
        "GPIO: " + (version.empty() ? "built without libgpiod" : "libgpiod " + version);
    if (!real_) {
      section(
          title,
          "  The configuration selects the simulated rig (gpio/backend: simulated), so no line is\n"
          "  checked. To check the lines, add --backend libgpiod.\n");
      verdict_ = "the configuration is right, and the simulated rig can sustain every step rate.";
      return;
    }
    const std::vector<gpio::ChipInfo> chips = gpio::gpioChips();
    const LinesReport report = linesReport(chips, linesOf(config_.axes, config_.options()));
    section(title, chipsText(chips) + "\n" + report.text);
    if (report.missing == 0) return;
    note(kExitLines,
         fmt::format(
             "{} {} not available (see above), so the calls and step rates weren't measured.",
             report.missing, report.missing == 1 ? "line is" : "lines are"));
  }

  // Their lines were found, and nothing else holds them.
  void reportDrivers() {
    const auto has_tmc = [](const config::AxisConfig& axis) { return axis.hasTmc(); };
    if (!real_ || exit_code_ != kExitGood ||
        std::none_of(config_.axes.begin(), config_.axes.end(), has_tmc)) {
      return;
    }
    try {
      const auto backend = gpio::makeLibgpiodBackend();
      const auto findings = setup::checkDrivers(config_.axes, *backend, options_.wiring);
      section("Drivers on a UART", driversText(findings));
      const auto wrong =
          std::count_if(findings.begin(), findings.end(),
                        [](const setup::DriverFinding& finding) { return !finding.is_right; });
      if (wrong > 0) {
        note(kExitDrivers, "a driver on a UART, or a line to one, is wrong (see above).");
      }
    } catch (const GpioError& error) {
      note(kExitLines, error.what());
    }
  }

  void measure() {
    if (real_ && (exit_code_ == kExitGood || exit_code_ == kExitDrivers)) {
      try {
        const auto backend = gpio::makeLibgpiodBackend();
        capability_ = machine::measure(config_.axes, *backend, clock_, config_.options().realtime);
        return;
      } catch (const GpioError& error) {
        note(kExitLines, error.what());
      }
    }
    capability_ = pulse::measureWakeUps(clock_, config_.options().realtime);
  }

  void reportRates() {
    if (capability_.channels.empty()) return;
    capability_.late_steps = config_.late_steps;
    const machine::StepRates rates = machine::stepRates(config_.axes, capability_);
    section("Step rates at which about one step in a hundred is late, or fewer", ratesText(rates));
    if (!rates.holds()) {
      note(kExitRates,
           fmt::format(
               "this computer can't sustain the top speed of {}. Lower that or the microsteps, "
               "allow "
               "real-time scheduling, use a PREEMPT_RT kernel, or reduce this computer's load.",
               tooFast(rates)));
    } else if (config_.enforce_realtime) {
      const std::string why = machine::whyNotInRealtime(config_.axes, capability_);
      if (!why.empty()) note(kExitRates, "the node won't start (realtime: enforce): " + why + ".");
    }
  }

  void move() {
    if (!real_ || exit_code_ == kExitLines) {
      note(kExitMove,
           "no axis was moved: gpio/backend is \"simulated\", but --move needs \"libgpiod\", which "
           "--backend libgpiod sets.");
      return;
    }
    print(
        fmt::format("Moving in {} s: keep clear. The program doesn't know the positions of the "
                    "axes. Ctrl-C stops them.\n",
                    kWarning.count()));
    InterruptWatch::block();
    bool back = false;
    try {
      if (InterruptWatch::comesWithin(kWarning)) throw Error("interrupted");
      const MoveOrder order{config_.axes, options_.axis, options_.distance, config_.options()};
      const auto backend = gpio::makeLibgpiodBackend();
      back = moveForthAndBack(order, *backend, clock_,
                              [](const std::string& line) { print(line + "\n"); });
    } catch (const Error& error) {
      print(std::string("  ") + error.what() + "\n");
    }
    print("\n");
    if (!back) note(kExitMove, "not every axis moved back and forth, see above.");
  }

  const Options options_;
  const ros_node::NodeConfig config_;
  const bool real_;
  pulse::SteadyClock clock_;
  pulse::Capability capability_;
  int exit_code_ = kExitGood;
  std::string verdict_ = "every line is available, and every axis's top speed can be sustained.";
};

bool hasAxis(const std::vector<config::AxisConfig>& axes, const std::string& name) {
  return std::any_of(axes.begin(), axes.end(),
                     [&](const config::AxisConfig& axis) { return axis.name == name; });
}

int run(const std::vector<std::string>& arguments) {
  Options options;
  try {
    options = parseOptions(arguments);
  } catch (const Error& error) {
    std::fprintf(stderr, "stepdriver_check: %s\n%s", error.what(), kUsage);
    return kExitUsage;
  }
  if (options.help) {
    print(kUsage);
    return kExitGood;
  }
  try {
    ros_node::NodeConfig config = readConfiguration(options.config, options.backend);
    if (!options.axis.empty() && !hasAxis(config.axes, options.axis)) {
      std::fprintf(stderr, "stepdriver_check: --axis %s: %s has no such axis\n",
                   options.axis.c_str(), options.config.c_str());
      return kExitUsage;
    }
    return Check(std::move(options), std::move(config)).run();
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "stepdriver_check: %s: %zu %s\n", options.config.c_str(),
                 error.issues().size(), error.issues().size() == 1 ? "error" : "errors");
    for (const ConfigIssue& issue : error.issues()) {
      std::fprintf(stderr, "  %s %s\n", issue.key.c_str(), issue.message.c_str());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stepdriver_check: %s\n", error.what());
  }
  return kExitConfig;
}

}  // namespace
}  // namespace stepdriver::check

int main(int argc, char** argv) {
  return stepdriver::check::run(std::vector<std::string>(argv + 1, argv + argc));
}
