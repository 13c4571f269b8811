#include "config/read_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "config/position_compare.h"
#include "config/read_axes.h"
#include "config/write_axes.h"
#include "message_text.h"
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

std::int64_t readTime(ConfigReader& reader, const char* key) {
  constexpr Range kTimesMs{0.0, 10'000.0};
  return readMilliseconds(reader, key, kTimesMs);
}

/// What the position of an axis makes an output do, in the units of the axis.
class CompareReader {
 public:
  CompareReader(ConfigReader& reader, const AxisConfig& axis)
      : reader_(reader),
        unit_(axis.kind == Kind::kLinear ? "_mm" : "_deg"),
        scale_(1.0 / configUnitsPerUnit(axis.kind)) {}

  void read(PositionCompare& compare) {
    using Direction = PositionCompare::Direction;
    const std::string direction = reader_.oneOf("direction", {"both", "up", "down"}, "both");
    if (direction != "both")
      compare.direction = direction == "up" ? Direction::kUp : Direction::kDown;
    const std::string distance = "every" + unit_;
    if (reader_.has(distance)) {
      const auto number = [this](const std::string& key) {
        return scale_ * reader_.number(key + unit_, kPlaces);
      };
      compare.every = PositionCompare::Every{number("every"), number("from"), number("to")};
    }
    compare.places = numbers("places" + unit_, list("places" + unit_));
    for (const ConfigValue& cam : list("cams" + unit_)) {
      const auto* ends = cam.as<ConfigValue::List>();
      const std::vector<double> places =
          ends != nullptr ? numbers("cams" + unit_, *ends) : std::vector<double>{};
      if (places.size() == 2) {
        compare.cams.push_back({places[0], places[1]});
      } else {
        reader_.issue("cams" + unit_, fmt::format("has {}, but each cam must be a list of two "
                                                  "places, where it begins and ends",
                                                  cam.shown()));
      }
    }
    compare.at_end = reader_.boolean("at_end", false);
    compare.pulse_ns = readTime(reader_, "pulse_ms");
    compare.lead_on_ns = readTime(reader_, "lead_on_ms");
    compare.lead_off_ns = readTime(reader_, "lead_off_ms");
  }

 private:
  static constexpr Range kPlaces{-1e12, 1e12};

  ConfigValue::List list(const std::string& key) {
    reader_.allow(key);
    if (!reader_.has(key)) return {};
    if (const auto* list = reader_.value(key).as<ConfigValue::List>()) return *list;
    reader_.issue(key, fmt::format("is {}, but must be a list", reader_.shown(key)));
    return {};
  }

  std::vector<double> numbers(const std::string& key, const ConfigValue::List& list) {
    std::vector<double> found;
    for (const ConfigValue& value : list) {
      const int* integer = value.as<int>();
      const double* real = value.as<double>();
      const double number = integer != nullptr ? *integer : real != nullptr ? *real : std::nan("");
      if (kPlaces.holds(number)) {
        found.push_back(scale_ * number);
      } else {
        reader_.issue(key, fmt::format("has {}, but must have places only", value.shown()));
      }
    }
    return found;
  }

  ConfigReader& reader_;
  const std::string unit_;
  const double scale_;
};

const AxisConfig* axisNamed(const std::vector<AxisConfig>& axes, const std::string& name) {
  const auto found = std::find_if(axes.begin(), axes.end(),
                                  [&](const AxisConfig& axis) { return axis.name == name; });
  return found != axes.end() ? &*found : nullptr;
}

void readCompare(ConfigReader compare, OutputConfig& output, const std::vector<AxisConfig>& axes) {
  const auto name = compare.findText("axis", Presence::kRequired);
  if (!name) return;
  const AxisConfig* axis = axisNamed(axes, *name);
  if (axis == nullptr) {
    return compare.issue(
        "axis", fmt::format("is \"{}\", but the axes are {}", printable(*name),
                            joinedText(axes, [](const AxisConfig& any) { return any.name; })));
  }
  output.compare.emplace();
  output.compare->axis = *name;
  const std::size_t issues = compare.issues().size();
  CompareReader(compare, *axis).read(*output.compare);
  compare.rejectUnknown();
  if (compare.issues().size() != issues) return;
  const std::string why = whyNotCompared(*output.compare, output, *axis);
  if (!why.empty()) compare.issue("", why);
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
template <typename Config, typename Read>
std::vector<Config> readNamed(ConfigReader& machine, const char* key, const char* what,
                              UsedLines& used, const Read& read) {
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

std::vector<OutputConfig> readOutputs(ConfigReader& machine, UsedLines& used,
                                      const std::vector<AxisConfig>* axes) {
  return readNamed<OutputConfig>(machine, "outputs", "an output", used,
                                 [axes](ConfigReader& reader, UsedLines& lines) {
                                   OutputConfig output = readOutput(reader, lines);
                                   reader.allow("position_compare");
                                   if (axes != nullptr && reader.has("position_compare")) {
                                     readCompare(reader.map("position_compare"), output, *axes);
                                   }
                                   return output;
                                 });
}

void checkCompares(const std::vector<OutputConfig>& outputs, const std::vector<AxisConfig>& axes,
                   std::vector<ConfigIssue>& issues) {
  for (const OutputConfig& output : outputs) {
    if (!output.compare) continue;
    const std::string name = fmt::format("outputs/{}/position_compare", printable(output.name));
    const AxisConfig* axis = axisNamed(axes, output.compare->axis);
    if (axis == nullptr) {
      issues.push_back({name + "/axis", fmt::format("is \"{}\", but there is no such axis",
                                                    printable(output.compare->axis))});
    } else if (const std::string why = whyNotCompared(*output.compare, output, *axis);
               !why.empty()) {
      issues.push_back({name, why});
    }
  }
}

std::vector<InputConfig> readInputs(ConfigReader& machine, UsedLines& used) {
  return readNamed<InputConfig>(machine, "inputs", "an input", used, readInput);
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
