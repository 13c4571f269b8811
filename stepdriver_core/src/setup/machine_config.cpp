#include "stepdriver_core/setup/machine_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "config/read_axes.h"
#include "config/read_homing.h"
#include "config/read_io.h"
#include "config/read_kinematics.h"
#include "machine/read_options.h"
#include "pulse/cpu_latency.h"
#include "setup/read_boards.h"
#include "setup/read_machine_config.h"
#include "setup/read_simulation.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::setup {
namespace {

using config::ConfigReader;
using config::ConfigValue;

constexpr int kMostRecordings = 1000;

const std::vector<std::string> kPolicies = {"warn", "enforce"};

/// Keys of a configuration that only the ROS node uses.
constexpr const char* kNodeKeys[] = {"joint_state_rate", "jog_timeout",   "urdf_limits",
                                     "hardware_id",      "publish_clock", "on_master_lost",
                                     "trajectory",       "setpoint"};

void readGpio(ConfigReader gpio, MachineConfig& config) {
  const std::string backend = gpio.oneOf("backend", {"simulated", "libgpiod"});
  if (backend == "libgpiod" && gpio::libgpiodVersion().empty()) {
    gpio.issue(
        "backend",
        "is \"libgpiod\", but stepdriver was built without it, so that it must be simulated; "
        "install libgpiod-dev and build again for real lines");
  }
  config.backend = backend == "libgpiod" ? GpioBackend::kLibgpiod : GpioBackend::kSimulated;
  config.write_timeout = machine::readWriteTimeout(gpio, config.write_timeout);
  gpio.rejectUnknown();
}

void readRealtime(ConfigReader realtime, MachineConfig& config) {
  config.enforce_realtime = realtime.oneOf("policy", kPolicies, "warn") == "enforce";
  config.max_lateness = machine::readMaxLateness(realtime, config.max_lateness);
  config.late_steps = machine::readLateSteps(realtime, config.late_steps);
  config.keep_cpus_awake = realtime.boolean("keep_cpus_awake", config.keep_cpus_awake);
  config.cpu = machine::readProcessor(realtime);
  realtime.rejectUnknown();
}

void readRecorder(ConfigReader reader, RecorderConfig& recorder) {
  machine::readRecorderSize(reader, recorder.seconds, recorder.memory_mb);
  recorder.folder = machine::readAbsolutePath(reader, "folder", recorder.folder, "the default");
  recorder.keep = reader.integer("keep", 1, kMostRecordings, recorder.keep);
  reader.rejectUnknown();
}

// What a line on a board can't be, and whether there is such a board.
void checkBoards(const ConfigReader& reader, const MachineConfig& config,
                 const config::UsedLines& used) {
  std::vector<ConfigIssue>& issues = reader.issues();
  std::string names;
  for (const BoardConfig& board : config.boards) names += (names.empty() ? "" : ", ") + board.name;
  const auto board_of = [&](const std::string& line) {
    const auto colon = line.find(':');
    return std::any_of(config.boards.begin(), config.boards.end(), [&](const BoardConfig& board) {
      return line.substr(0, colon) == board.name;
    });
  };
  used.forEach([&](const std::string& line, const std::string& key) {
    const auto colon = line.rfind(':');
    const bool is_pin = colon != std::string::npos && line[colon + 1] > '9';
    if (!is_pin || board_of(line)) return;
    issues.push_back({key, fmt::format("is \"{}\", but there is no board {} ({}: {})", line,
                                       line.substr(0, colon), reader.fullName("boards"),
                                       names.empty() ? "none" : names)});
  });
  const auto refuse = [&](const std::string& key, const std::string& line) {
    if (line.find(':') == std::string::npos || !board_of(line)) return;
    issues.push_back({reader.fullName(key),
                      fmt::format("is \"{}\", but it can't be on a board: its times would be "
                                  "those of the line to the board",
                                  line)});
  };
  if (config.heartbeat) refuse("heartbeat/pin", config.heartbeat->line);
  for (const auto& output : config.outputs) refuse("outputs/" + output.name + "/pin", output.line);
  for (const auto& input : config.inputs) refuse("inputs/" + input.name + "/pin", input.line.line);
}

}  // namespace

machine::MachineOptions MachineConfig::options() const {
  machine::MachineOptions options;
  options.max_lateness = max_lateness;
  options.late_steps = late_steps;
  options.write_timeout = write_timeout;
  options.measure = true;
  options.enforce = enforce_realtime;
  options.emergency_stop = emergency_stop;
  options.emergency_disable = emergency_disable;
  options.heartbeat = heartbeat;
  options.motor_power = motor_power;
  options.outputs = outputs;
  options.inputs = inputs;
  options.state_file = state_file;
  options.record_seconds = recorder.seconds;
  options.record_bytes = static_cast<std::size_t>(recorder.memory_mb * 1e6);
  options.realtime.latency_device = keep_cpus_awake ? pulse::kCpuLatencyDevice : "";
  options.realtime.cpu = cpu;
  return options;
}

MachineConfig readMachineConfig(ConfigReader& reader) {
  MachineConfig config;
  readGpio(reader.map("gpio"), config);
  config.state_file = machine::readAbsolutePath(reader, "state_file", config.state_file, "none");
  readRecorder(reader.map("recorder"), config.recorder);
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
  ConfigReader kinematics = reader.map("kinematics");
  if (reader.has("kinematics")) {
    config::readKinematics(std::move(kinematics), axes_are_right, config.axes);
  }
  config.motor_power = machine::readMotorPower(reader, used);
  machine::readEmergencyStop(reader, axes_are_right ? &config.axes : nullptr,
                             config.motor_power.has_value(), config.emergency_disable,
                             config.emergency_stop, used);
  config.heartbeat = machine::readHeartbeat(reader, used);
  config.outputs = config::readOutputs(reader, used, axes_are_right ? &config.axes : nullptr);
  config.inputs = config::readInputs(reader, used);
  config::checkHomingInputs(config.axes, config.inputs, reader.fullName("axes"), reader.issues());
  config.boards = readBoards(reader.map("boards"));
  checkBoards(reader, config, used);
  ConfigReader simulation = reader.map("simulation");
  if (simulation.has("emergency_stop") && !config.emergency_stop) {
    simulation.contradiction("emergency_stop", fmt::format("is {}, but {} is missing",
                                                           simulation.shown("emergency_stop"),
                                                           reader.fullName("emergency_stop/pin")));
  }
  const std::string simulation_speed = simulation.fullName("speed");
  config.simulation = readSimulation(std::move(simulation), config.axes, axes_are_right,
                                     config.outputs, config.inputs);
  if (config.heartbeat && config.backend == GpioBackend::kSimulated &&
      config.simulation.speed == 0.0) {
    reader.contradiction("heartbeat",
                         fmt::format("is given, but {} is 0: it would make the time of the rig "
                                     "run on at rest too; leave it out, or give another speed",
                                     simulation_speed));
  }
  if (!config.boards.empty() && config.backend == GpioBackend::kSimulated &&
      config.simulation.speed == 0.0) {
    reader.contradiction("boards",
                         fmt::format("are given, but {} is 0: they would make the time of the rig "
                                     "run on at rest too; leave them out, or give another speed",
                                     simulation_speed));
  }
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
