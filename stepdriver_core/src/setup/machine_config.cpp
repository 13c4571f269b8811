#include "stepdriver_core/setup/machine_config.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "config/read_axes.h"
#include "config/read_kinematics.h"
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
constexpr Range kRecordedSeconds{0.0, 600.0};
constexpr Range kRecorderMemory{1.0, 1000.0};
constexpr Range kHeartbeatRates{1.0, 1000.0};  // Hz
constexpr Range kPowerTimesMs{0.0, 60'000.0};
constexpr Range kFeedbackTimeoutsMs{1.0, 60'000.0};
constexpr int kMostProcessors = 1024;  // CPU_SETSIZE of the C library
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
  config.cpu = realtime.findInteger("cpu", 0, kMostProcessors - 1, config::Presence::kOptional);
  realtime.rejectUnknown();
}

void refuseRelativePath(ConfigReader& reader, const std::string& key, const std::string& path,
                        const char* otherwise) {
  if (path.empty() || path[0] == '/') return;
  reader.issue(key, fmt::format("is {}, but must be an absolute path, or empty for {}",
                                reader.shown(key), otherwise));
}

void readRecorder(ConfigReader reader, RecorderConfig& recorder) {
  recorder.seconds = reader.number("seconds", kRecordedSeconds, recorder.seconds);
  recorder.memory_mb = reader.number("memory_mb", kRecorderMemory, recorder.memory_mb);
  recorder.folder = reader.text("folder", recorder.folder);
  refuseRelativePath(reader, "folder", recorder.folder, "the default");
  recorder.keep = reader.integer("keep", 1, kMostRecordings, recorder.keep);
  reader.rejectUnknown();
}

std::optional<machine::HeartbeatConfig> readHeartbeat(ConfigReader& machine,
                                                      config::UsedLines& used) {
  ConfigReader reader = machine.map("heartbeat");
  if (!machine.has("heartbeat")) return {};
  machine::HeartbeatConfig heartbeat;
  heartbeat.line = config::readRequiredLine(reader, "pin", used);
  heartbeat.rate = reader.number("rate_hz", kHeartbeatRates, heartbeat.rate);
  reader.rejectUnknown();
  return heartbeat;
}

std::optional<config::MotorPowerConfig> readMotorPower(ConfigReader& machine,
                                                       config::UsedLines& used) {
  ConfigReader reader = machine.map("motor_power");
  if (!machine.has("motor_power")) return {};
  const auto nanoseconds = [&reader](const char* key, Range range,
                                     std::optional<double> otherwise) {
    const double milliseconds =
        otherwise ? reader.number(key, range, *otherwise) : reader.number(key, range);
    return std::llround(milliseconds * 1e6);
  };
  config::MotorPowerConfig power;
  power.line = config::readRequiredLine(reader, "pin", used);
  power.active_level = reader.oneOf("active_level", {"low", "high"}, "high") == "high";
  power.on_ns = nanoseconds("on_ms", kPowerTimesMs, std::nullopt);
  power.off_delay_ns = nanoseconds("off_delay_ms", kPowerTimesMs, 0.0);
  ConfigReader contact = reader.map("feedback");
  if (reader.has("feedback")) {
    power.feedback = config::readInputSwitch(contact, used);
    contact.rejectUnknown();
    power.feedback_timeout_ns = nanoseconds("feedback_timeout_ms", kFeedbackTimeoutsMs,
                                            static_cast<double>(power.feedback_timeout_ns) / 1e6);
  }
  reader.rejectUnknown();
  return power;
}

machine::EmergencyDisable readDisable(ConfigReader& reader) {
  // YAML 1.1 takes off for a boolean.
  const bool* flag = reader.value("disable").as<bool>();
  const bool is_off = flag != nullptr && !*flag;
  if (is_off) reader.allow("disable");
  const std::string how = is_off ? "off" : reader.oneOf("disable", {"hold", "ramp", "off"}, "hold");
  if (how == "off") return machine::EmergencyDisable::kOff;
  return how == "ramp" ? machine::EmergencyDisable::kRamp : machine::EmergencyDisable::kHold;
}

void readEmergencyStop(ConfigReader& machine, bool axes_are_right, MachineConfig& config,
                       config::UsedLines& used) {
  ConfigReader reader = machine.map("emergency_stop");
  if (!machine.has("emergency_stop")) return;
  config.emergency_disable = readDisable(reader);
  const bool has_button = !reader.has("disable") || reader.has("pin") ||
                          reader.has("active_level") || reader.has("bias");
  if (has_button) config.emergency_stop = config::readInputSwitch(reader, used);
  reader.rejectUnknown();
  if (!axes_are_right || config.emergency_disable == machine::EmergencyDisable::kHold) return;
  if (config.motor_power) return;
  for (const config::AxisConfig& axis : config.axes) {
    if (axis.pins.enable.wired()) continue;
    reader.contradiction(
        "disable",
        fmt::format("is {}, but axes/{}/pins/enable is missing, and there is no motor_power: "
                    "nothing could switch the current of this motor off",
                    config.emergency_disable == machine::EmergencyDisable::kOff ? "off" : "ramp",
                    axis.name));
  }
}

}  // namespace

machine::MachineOptions MachineConfig::options() const {
  machine::MachineOptions options;
  options.max_lateness = max_lateness;
  options.write_timeout = write_timeout;
  options.measure = true;
  options.enforce = enforce_realtime;
  options.emergency_stop = emergency_stop;
  options.emergency_disable = emergency_disable;
  options.heartbeat = heartbeat;
  options.motor_power = motor_power;
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
  config.state_file = reader.text("state_file", config.state_file);
  refuseRelativePath(reader, "state_file", config.state_file, "none");
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
  config.motor_power = readMotorPower(reader, used);
  readEmergencyStop(reader, axes_are_right, config, used);
  config.heartbeat = readHeartbeat(reader, used);
  ConfigReader simulation = reader.map("simulation");
  if (simulation.has("emergency_stop") && !config.emergency_stop) {
    simulation.contradiction("emergency_stop", fmt::format("is {}, but {} is missing",
                                                           simulation.shown("emergency_stop"),
                                                           reader.fullName("emergency_stop/pin")));
  }
  const std::string simulation_speed = simulation.fullName("speed");
  config.simulation = readSimulation(std::move(simulation), config.axes, axes_are_right);
  if (config.heartbeat && config.backend == GpioBackend::kSimulated &&
      config.simulation.speed == 0.0) {
    reader.contradiction("heartbeat",
                         fmt::format("is given, but {} is 0: it would make the time of the rig "
                                     "run on at rest too; leave it out, or give another speed",
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
