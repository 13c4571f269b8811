#include "read_options.h"

#include <fmt/format.h>

#include <cmath>
#include <set>
#include <utility>

#include "config/check_axes.h"
#include "config/read_axes.h"
#include "config/read_homing.h"
#include "config/read_io.h"
#include "config/write_axes.h"
#include "printable.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

using config::ConfigReader;
using config::ConfigValue;
using config::Range;

constexpr Range kWriteTimeoutsMs{10.0, 60'000.0};
constexpr Range kLatenessesMs{0.0, 60'000.0, true};
constexpr Range kLateSteps{0.0, 0.5};
constexpr Range kRecordedSeconds{0.0, 600.0};
constexpr Range kRecorderMemoryMb{1.0, 1000.0};
constexpr Range kHeartbeatRates{1.0, 1000.0};  // Hz
constexpr Range kPowerTimesMs{0.0, 60'000.0};
constexpr Range kFeedbackTimeoutsMs{1.0, 60'000.0};
constexpr int kMostProcessors = 1024;  // CPU_SETSIZE of the C library

const std::vector<std::string> kDisables = {"hold", "ramp", "off"};  // in the order of the enum

double milliseconds(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) / 1e6; }

EmergencyDisable readDisable(ConfigReader& reader) {
  // YAML 1.1 takes off for a boolean.
  const bool* flag = reader.value("disable").as<bool>();
  const bool is_off = flag != nullptr && !*flag;
  if (is_off) reader.allow("disable");
  const std::string how = is_off ? "off" : reader.oneOf("disable", kDisables, "hold");
  if (how == "off") return EmergencyDisable::kOff;
  return how == "ramp" ? EmergencyDisable::kRamp : EmergencyDisable::kHold;
}

ConfigValue::Map writeMotorPower(const config::MotorPowerConfig& power) {
  ConfigValue::Map map{{"pin", power.line},
                       {"active_level", power.active_level ? "high" : "low"},
                       {"on_ms", milliseconds(power.on_ns)},
                       {"off_delay_ms", milliseconds(power.off_delay_ns)}};
  if (!power.feedback) return map;
  map["feedback"] = config::writeSwitch(*power.feedback);
  map["feedback_timeout_ms"] = milliseconds(power.feedback_timeout_ns);
  return map;
}

ConfigValue writeOptions(const MachineOptions& options) {
  ConfigValue::Map stop;
  if (options.emergency_stop) stop = config::writeSwitch(*options.emergency_stop);
  stop["disable"] = kDisables.at(static_cast<std::size_t>(options.emergency_disable));
  ConfigValue::Map realtime{{"max_lateness_ms", options.max_lateness * 1e3},
                            {"late_steps", options.late_steps}};
  if (options.realtime.cpu) realtime["cpu"] = *options.realtime.cpu;
  ConfigValue::Map map{
      {"gpio", ConfigValue::Map{{"write_timeout_ms", options.write_timeout * 1e3}}},
      {"realtime", std::move(realtime)},
      {"emergency_stop", std::move(stop)},
      {"state_file", options.state_file}};
  if (options.record_seconds != 0.0) {
    map["recorder"] =
        ConfigValue::Map{{"seconds", options.record_seconds},
                         {"memory_mb", static_cast<double>(options.record_bytes) / 1e6}};
  }
  if (options.heartbeat) {
    map["heartbeat"] =
        ConfigValue::Map{{"pin", options.heartbeat->line}, {"rate_hz", options.heartbeat->rate}};
  }
  if (options.motor_power) map["motor_power"] = writeMotorPower(*options.motor_power);
  map["outputs"] = config::writeOutputs(options.outputs);
  map["inputs"] = config::writeInputs(options.inputs);
  return map;
}

/// @param what "outputs"
template <typename Config>
void checkNames(const std::vector<Config>& all, const char* what,
                std::vector<ConfigIssue>& issues) {
  std::set<std::string> names;
  for (const Config& one : all) {
    if (names.insert(one.name).second) continue;
    issues.push_back({fmt::format("{}/{}", what, printable(one.name)),
                      "is given twice, and each needs a name of its own", true});
  }
}

void checkOptions(const std::vector<config::AxisConfig>* axes, const MachineOptions& options,
                  std::vector<ConfigIssue>& issues, config::UsedLines& used) {
  const ConfigValue tree = writeOptions(options);
  ConfigReader reader(tree, "", issues);
  ConfigReader gpio = reader.map("gpio");
  ConfigReader realtime = reader.map("realtime");
  ConfigReader recorder = reader.map("recorder");
  MachineOptions read;
  readWriteTimeout(gpio, 0.0);
  readMaxLateness(realtime, 0.0);
  readLateSteps(realtime, 0.0);
  readProcessor(realtime);
  double memory_mb = kRecorderMemoryMb.max;
  readRecorderSize(recorder, read.record_seconds, memory_mb);
  readAbsolutePath(reader, "state_file", "", "none");
  read.motor_power = readMotorPower(reader, used);
  readEmergencyStop(reader, axes, read.motor_power.has_value(), read.emergency_disable,
                    read.emergency_stop, used);
  read.heartbeat = readHeartbeat(reader, used);
  checkNames(options.outputs, "outputs", issues);
  checkNames(options.inputs, "inputs", issues);
  config::readOutputs(reader, used, nullptr);
  if (axes != nullptr) config::checkCompares(options.outputs, *axes, issues);
  config::readInputs(reader, used);
}

}  // namespace

double readWriteTimeout(ConfigReader& gpio, double otherwise) {
  return 1e-3 * gpio.number("write_timeout_ms", kWriteTimeoutsMs, otherwise * 1e3);
}

double readMaxLateness(ConfigReader& realtime, double otherwise) {
  return 1e-3 * realtime.number("max_lateness_ms", kLatenessesMs, otherwise * 1e3);
}

double readLateSteps(ConfigReader& realtime, double otherwise) {
  return realtime.number("late_steps", kLateSteps, otherwise);
}

std::optional<int> readProcessor(ConfigReader& realtime) {
  return realtime.findInteger("cpu", 0, kMostProcessors - 1, config::Presence::kOptional);
}

void readRecorderSize(ConfigReader& recorder, double& seconds, double& memory_mb) {
  seconds = recorder.number("seconds", kRecordedSeconds, seconds);
  memory_mb = recorder.number("memory_mb", kRecorderMemoryMb, memory_mb);
}

std::string readAbsolutePath(ConfigReader& reader, const std::string& key,
                             const std::string& fallback, const char* otherwise) {
  std::string path = reader.text(key, fallback);
  if (!path.empty() && path[0] != '/') {
    reader.issue(key, fmt::format("is {}, but must be an absolute path, or empty for {}",
                                  reader.shown(key), otherwise));
  }
  return path;
}

std::optional<HeartbeatConfig> readHeartbeat(ConfigReader& machine, config::UsedLines& used) {
  ConfigReader reader = machine.map("heartbeat");
  if (!machine.has("heartbeat")) return {};
  HeartbeatConfig heartbeat;
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
                                            milliseconds(power.feedback_timeout_ns));
  }
  reader.rejectUnknown();
  return power;
}

void readEmergencyStop(ConfigReader& machine, const std::vector<config::AxisConfig>* axes,
                       bool has_motor_power, EmergencyDisable& disable,
                       std::optional<config::InputSwitch>& button, config::UsedLines& used) {
  ConfigReader reader = machine.map("emergency_stop");
  if (!machine.has("emergency_stop")) return;
  disable = readDisable(reader);
  const bool has_button = !reader.has("disable") || reader.has("pin") ||
                          reader.has("active_level") || reader.has("bias");
  if (has_button) button = config::readInputSwitch(reader, used);
  reader.rejectUnknown();
  if (axes == nullptr || disable == EmergencyDisable::kHold || has_motor_power) return;
  for (const config::AxisConfig& axis : *axes) {
    if (axis.hasSwitchedCurrent()) continue;
    reader.contradiction(
        "disable",
        fmt::format("is {}, but axes/{}/pins/enable is missing, and there is no motor_power: "
                    "nothing could switch the current of this motor off",
                    kDisables.at(static_cast<std::size_t>(disable)), axis.name));
  }
}

void checkConfiguration(const std::vector<config::AxisConfig>& axes,
                        const MachineOptions& options) {
  std::vector<ConfigIssue> issues;
  config::UsedLines used(issues);
  config::checkAxes(axes, issues, used);
  checkOptions(issues.empty() ? &axes : nullptr, options, issues, used);
  config::checkHomingInputs(axes, options.inputs, "axes", issues);
  if (issues.empty()) return;
  for (ConfigIssue& issue : issues) issue.key.erase(0, issue.key.find_first_not_of('/'));
  throw ConfigError(std::move(issues));
}

}  // namespace stepdriver::machine
