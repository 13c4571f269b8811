#include "stepdriver_core/setup/machine_config.h"

#include <fmt/format.h>

#include <utility>

#include "config/read_axes.h"
#include "pulse/cpu_latency.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/setup/simulation.h"

namespace stepdriver::setup {
namespace {

using config::ConfigReader;
using config::ConfigValue;
using config::Range;

constexpr double kLongestLatenessMs = 1000.0;
constexpr double kShortestTimeoutMs = 10.0;
constexpr double kLongestTimeoutMs = 60'000.0;

const std::vector<std::string> kPolicies = {"warn", "enforce"};

/// Keys of a configuration that only the ROS node uses.
constexpr const char* kNodeKeys[] = {"joint_state_rate", "jog_timeout",   "urdf_limits",
                                     "hardware_id",      "publish_clock", "on_master_lost"};

void readGpio(ConfigReader gpio, MachineConfig& config) {
  const std::string backend = gpio.oneOf("backend", {"simulated", "libgpiod"});
  if (backend == "libgpiod" && gpio::libgpiodVersion().empty()) {
    gpio.issue(
        "backend",
        "is \"libgpiod\", but stepdriver was built without it, so that it must be simulated; "
        "install libgpiod-dev and build again for real lines");
  }
  config.backend = backend == "libgpiod" ? GpioBackend::kLibgpiod : GpioBackend::kSimulated;
  config.write_timeout =
      1e-3 * gpio.number("write_timeout_ms", Range{kShortestTimeoutMs, kLongestTimeoutMs},
                         config.write_timeout * 1e3);
  gpio.rejectUnknown();
}

void readRealtime(ConfigReader realtime, MachineConfig& config) {
  config.enforce_realtime = realtime.oneOf("policy", kPolicies, "warn") == "enforce";
  const double milliseconds = realtime.number(
      "max_lateness_ms", Range{0.0, kLongestLatenessMs, true}, config.max_lateness * 1e3);
  config.max_lateness = milliseconds * 1e-3;
  config.keep_cpus_awake = realtime.boolean("keep_cpus_awake", config.keep_cpus_awake);
  realtime.rejectUnknown();
}

}  // namespace

machine::MachineOptions MachineConfig::options() const {
  machine::MachineOptions options;
  options.max_lateness = max_lateness;
  options.write_timeout = write_timeout;
  options.measure = true;
  options.enforce = enforce_realtime;
  options.emergency_stop = emergency_stop;
  options.state_file = state_file;
  options.latency_device = keep_cpus_awake ? pulse::kCpuLatencyDevice : "";
  return options;
}

MachineConfig readMachineConfig(ConfigReader& reader) {
  MachineConfig config;
  readGpio(reader.map("gpio"), config);
  config.state_file = reader.text("state_file", config.state_file);
  if (!config.state_file.empty() && config.state_file[0] != '/') {
    reader.issue("state_file", fmt::format("is {}, but must be an absolute path, or empty for none",
                                           reader.shown("state_file")));
  }
  if (reader.value("realtime").as<std::string>() != nullptr) {
    config.enforce_realtime = reader.oneOf("realtime", kPolicies) == "enforce";
  } else {
    readRealtime(reader.map("realtime"), config);
  }

  const std::size_t issues_before = reader.issues().size();
  reader.allow("axes");
  config::UsedLines used(reader.issues());
  config.axes =
      config::readAxes(reader.value("axes"), reader.fullName("axes"), reader.issues(), used);
  const bool axes_are_right = reader.issues().size() == issues_before;
  config.emergency_stop = config::readInputSwitch(reader, "emergency_stop", used);
  ConfigReader simulation = reader.map("simulation");
  if (simulation.has("emergency_stop") && !reader.has("emergency_stop")) {
    simulation.contradiction("emergency_stop", fmt::format("is {}, but {} is missing",
                                                           simulation.shown("emergency_stop"),
                                                           reader.fullName("emergency_stop")));
  }
  config.simulation = readSimulation(std::move(simulation), config.axes, axes_are_right);
  if (config.backend == GpioBackend::kLibgpiod && !config.simulation.trace.empty()) {
    reader.contradiction(
        "simulation/trace",
        fmt::format("is \"{}\", but only the simulated rig has a trace, and gpio/backend "
                    "is libgpiod; leave it out or empty",
                    config.simulation.trace));
  }
  return config;
}

void chooseBackend(ConfigValue& tree, BackendChoice choice) {
  auto* map = tree.as<ConfigValue::Map>();
  if (map == nullptr) return;
  auto* gpio = map->emplace("gpio", ConfigValue::Map{}).first->second.as<ConfigValue::Map>();
  if (gpio == nullptr) return;
  if (choice == BackendChoice::kAsInTheFile) {
    gpio->emplace("backend", "libgpiod");
    return;
  }
  const bool simulated = choice == BackendChoice::kSimulated;
  (*gpio)["backend"] = simulated ? "simulated" : "libgpiod";
  // A trace with GPIO lines is an issue, but here the user did not ask for both.
  const auto simulation = simulated ? map->end() : map->find("simulation");
  if (simulation == map->end()) return;
  if (auto* keys = simulation->second.as<ConfigValue::Map>()) keys->erase("trace");
}

MachineConfig machineConfigOf(ConfigValue tree, BackendChoice choice) {
  chooseBackend(tree, choice);
  std::vector<ConfigIssue> issues;
  ConfigReader reader(tree, "", issues);
  for (const char* key : kNodeKeys) reader.allow(key);
  MachineConfig config = readMachineConfig(reader);
  reader.rejectUnknown();
  // The rig can be checked only if the axes are right.
  if (issues.empty() && config.backend == GpioBackend::kSimulated) {
    checkSimulation(config.axes, config.simulation, "simulation", issues);
  }
  throwIssues(std::move(issues));
  return config;
}

void throwIssues(std::vector<ConfigIssue> issues) {
  if (issues.empty()) return;
  for (ConfigIssue& issue : issues) issue.key.erase(0, issue.key.find_first_not_of('/'));
  throw ConfigError(std::move(issues));
}

}  // namespace stepdriver::setup
