#include "config/read_io.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "config/read_axes.h"
#include "config/write_axes.h"
#include "printable.h"

namespace stepdriver::config {
namespace {

// [s] The longest time that an output may be on: at least a millisecond, which the controller's
// thread can time, and at most a day.
constexpr Range kMostOnSeconds{1e-3, 86'400.0};
constexpr Range kLeastTimesMs{0.0, 60'000.0};
constexpr Range kDebouncesMs{0.0, 1000.0};

/// YAML 1.1 takes on and off without quotes for booleans.
const bool* flagOf(ConfigReader& reader, const char* key) {
  const bool* flag = reader.value(key).as<bool>();
  if (flag != nullptr) reader.allow(key);
  return flag;
}

bool readOn(ConfigReader& reader, const char* key) {
  if (const bool* flag = flagOf(reader, key)) return *flag;
  return reader.oneOf(key, {"off", "on"}, "off") == "on";
}

std::optional<bool> readAtStop(ConfigReader& reader) {
  constexpr const char* kKey = "at_stop";
  if (const bool* flag = flagOf(reader, kKey)) return *flag;
  const std::string wanted = reader.oneOf(kKey, {"keep", "off", "on"}, "keep");
  if (wanted == "keep") return {};
  return wanted == "on";
}

std::int64_t readMilliseconds(ConfigReader& reader, const char* key, const Range& range) {
  return std::llround(reader.number(key, range, 0.0) * 1e6);
}

/// What an output that may not stay on contradicts.
void checkMostOn(ConfigReader& reader, const OutputConfig& output) {
  constexpr const char* kKey = "max_on_s";
  if (!output.max_on_ns) return;
  const auto refuse = [&](const char* other, const char* why) {
    reader.contradiction(kKey, fmt::format("is {}, but {} is {}: {}", reader.shown(kKey),
                                           reader.fullName(other), reader.shown(other), why));
  };
  if (output.at_fault) refuse("at_fault", "in its safe state the output is on for any time");
  if (output.min_on_ns > *output.max_on_ns) {
    refuse("min_on_ms", "the output can't stay on for longer than it may");
  }
}

OutputConfig readOutput(ConfigReader& reader, UsedLines& used) {
  OutputConfig output;
  output.line = readRequiredLine(reader, "pin", used);
  output.active_level = reader.oneOf("active_level", {"low", "high"}, "high") == "high";
  output.initial = readOn(reader, "initial");
  output.at_stop = readAtStop(reader);
  output.at_fault = readOn(reader, "at_fault");
  if (const auto most = reader.findNumber("max_on_s", kMostOnSeconds, Presence::kOptional)) {
    output.max_on_ns = std::llround(*most * 1e9);
  }
  output.min_on_ns = readMilliseconds(reader, "min_on_ms", kLeastTimesMs);
  output.min_off_ns = readMilliseconds(reader, "min_off_ms", kLeastTimesMs);
  checkMostOn(reader, output);
  return output;
}

InputConfig readInput(ConfigReader& reader, UsedLines& used) {
  InputConfig input;
  input.line = readInputSwitch(reader, used);
  input.debounce_ns = readMilliseconds(reader, "debounce_ms", kDebouncesMs);
  return input;
}

/// @param what "an output"
template <typename Config>
std::vector<Config> readNamed(ConfigReader& machine, const char* key, const char* what,
                              UsedLines& used, Config (*read)(ConfigReader&, UsedLines&)) {
  ConfigReader all = machine.map(key);
  std::vector<Config> configs;
  for (const std::string& name : all.keys()) {
    ConfigReader reader = all.map(name);
    if (!isName(name)) {
      reader.issue("", fmt::format("has the name \"{}\", but the name of {} must begin with a "
                                   "letter and continue with letters, digits and _ only",
                                   printable(name), what));
    }
    configs.push_back(read(reader, used));
    configs.back().name = name;
    reader.rejectUnknown();
  }
  return configs;
}

const char* wordOf(bool on) { return on ? "on" : "off"; }

double millisecondsOf(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) / 1e6; }

}  // namespace

std::vector<OutputConfig> readOutputs(ConfigReader& machine, UsedLines& used) {
  return readNamed(machine, "outputs", "an output", used, readOutput);
}

std::vector<InputConfig> readInputs(ConfigReader& machine, UsedLines& used) {
  return readNamed(machine, "inputs", "an input", used, readInput);
}

ConfigValue::Map writeOutputs(const std::vector<OutputConfig>& outputs) {
  ConfigValue::Map all;
  for (const OutputConfig& output : outputs) {
    ConfigValue::Map map{{"pin", output.line},
                         {"active_level", output.active_level ? "high" : "low"},
                         {"initial", wordOf(output.initial)},
                         {"at_stop", output.at_stop ? wordOf(*output.at_stop) : "keep"},
                         {"at_fault", wordOf(output.at_fault)},
                         {"min_on_ms", millisecondsOf(output.min_on_ns)},
                         {"min_off_ms", millisecondsOf(output.min_off_ns)}};
    if (output.max_on_ns) map["max_on_s"] = static_cast<double>(*output.max_on_ns) / 1e9;
    all[output.name] = std::move(map);
  }
  return all;
}

ConfigValue::Map writeInputs(const std::vector<InputConfig>& inputs) {
  ConfigValue::Map all;
  for (const InputConfig& input : inputs) {
    ConfigValue::Map map = writeSwitch(input.line);
    map["debounce_ms"] = millisecondsOf(input.debounce_ns);
    all[input.name] = std::move(map);
  }
  return all;
}

}  // namespace stepdriver::config
