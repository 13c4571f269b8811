#include "config/read_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "config/least_time.h"
#include "config/position_compare.h"
#include "config/read_axes.h"
#include "config/write_axes.h"
#include "message_text.h"
#include "printable.h"
#include "pwm_line.h"

namespace stepdriver::config {
namespace {

// [s] The longest time that an output may be on: at least a millisecond, which the controller's
// thread can time, and at most a day.
constexpr Range kMostOnSeconds{1e-3, 86'400.0};
constexpr Range kLeastTimesMs{0.0, 60'000.0};
constexpr Range kDebouncesMs{0.0, 1000.0};
constexpr double kServoPeriodMs = 20.0;

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
  constexpr const char* kTooLong = "the output can't stay on for longer than it may";
  const LeastTime least = leastTime(output, true);
  if (output.min_on_ns > *output.max_on_ns) {
    refuse("min_on_ms", kTooLong);
  } else if (least.ns > *output.max_on_ns) {
    reader.contradiction(kKey,
                         fmt::format("is {}, but {} is {} s: {}", reader.shown(kKey), least.name,
                                     numberText(static_cast<double>(least.ns) / 1e9), kTooLong));
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

/// The channel of a PWM chip. @param key that of its map
PwmLine readChannel(ConfigReader& reader, const std::string& key, ConfigReader& pwm,
                    UsedLines& used) {
  constexpr int kMostChips = 1'000;
  PwmLine line;
  line.chip = pwm.integer("chip", 0, kMostChips);
  line.channel = pwm.integer("channel", 0, kMostChips);
  used.add(reader.fullName(key), line.name());
  return line;
}

std::int64_t lengthOf(double milliseconds) { return std::llround(milliseconds * 1e6); }

/// @param on the key of the length while it is on
std::string textOf(ConfigReader& pwm, const PwmLine& line, const char* on) {
  pwm.rejectUnknown();
  if (line.on_ns == line.off_ns) pwm.issue(on, "is the same as off: the output does nothing");
  return line.text();
}

/// A PWM output of the kernel: each state is a part of the period.
std::string readPwm(ConfigReader& reader, UsedLines& used) {
  constexpr Range kFrequencies{0.1, 1e6};
  constexpr Range kPercents{0.0, 100.0};
  ConfigReader pwm = reader.map("pwm");
  PwmLine line = readChannel(reader, "pwm", pwm, used);
  const auto frequency = pwm.findNumber("frequency_hz", kFrequencies, Presence::kRequired);
  line.period_ns = std::llround(1e9 / frequency.value_or(1.0));
  const auto length = [&](const char* key, double fallback) {
    return std::llround(0.01 * pwm.number(key, kPercents, fallback) *
                        static_cast<double>(line.period_ns));
  };
  line.off_ns = length("off_percent", 0.0);
  line.on_ns = length("on_percent", 100.0);
  return textOf(pwm, line, "on_percent");
}

/// The same with 50 pulses a second, whose lengths are the two places of a servo.
std::string readServo(ConfigReader& reader, UsedLines& used) {
  constexpr Range kLengthsMs{0.0, kServoPeriodMs};
  ConfigReader servo = reader.map("servo");
  PwmLine line = readChannel(reader, "servo", servo, used);
  line.period_ns = lengthOf(kServoPeriodMs);
  line.off_ns = lengthOf(servo.number("off_ms", kLengthsMs, 1.0));
  line.on_ns = lengthOf(servo.number("on_ms", kLengthsMs, 2.0));
  return textOf(servo, line, "on_ms");
}

/// Its line, and the level of that while it is on.
void readOutputLine(ConfigReader& reader, UsedLines& used, OutputConfig& output) {
  for (const char* key : {"pwm", "servo"}) reader.allow(key);
  const bool is_pwm = reader.has("pwm");
  const bool is_servo = reader.has("servo");
  if (is_pwm || is_servo) {
    output.line = is_pwm ? readPwm(reader, used) : readServo(reader, used);
    const char* const other = reader.has("pin") ? "pin" : is_pwm && is_servo ? "servo" : nullptr;
    if (other != nullptr) {
      reader.allow(other);
      reader.issue(other, fmt::format("contradicts {}: an output has one of pin, pwm and servo",
                                      reader.fullName(is_pwm ? "pwm" : "servo")));
    }
    return;
  }
  output.line = readRequiredLine(reader, "pin", used);
  output.active_level = reader.oneOf("active_level", {"low", "high"}, "high") == "high";
}

OutputConfig readOutput(ConfigReader& reader, UsedLines& used) {
  OutputConfig output;
  readOutputLine(reader, used, output);
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

void writeLine(const OutputConfig& output, ConfigValue::Map& map) {
  const std::optional<PwmLine> line = pwmLineOf(output.line);
  if (!line) {
    map["pin"] = output.line;
    map["active_level"] = output.active_level ? "high" : "low";
    return;
  }
  ConfigValue::Map channel{{"chip", line->chip}, {"channel", line->channel}};
  if (line->period_ns == lengthOf(kServoPeriodMs)) {
    channel["off_ms"] = millisecondsOf(line->off_ns);
    channel["on_ms"] = millisecondsOf(line->on_ns);
    map["servo"] = std::move(channel);
    return;
  }
  const auto percent_of = [&](std::int64_t length) {
    return 100.0 * static_cast<double>(length) / static_cast<double>(line->period_ns);
  };
  channel["frequency_hz"] = 1e9 / static_cast<double>(line->period_ns);
  channel["off_percent"] = percent_of(line->off_ns);
  channel["on_percent"] = percent_of(line->on_ns);
  map["pwm"] = std::move(channel);
}

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
    ConfigValue::Map map{{"initial", wordOf(output.initial)},
                         {"at_stop", output.at_stop ? wordOf(*output.at_stop) : "keep"},
                         {"at_fault", wordOf(output.at_fault)},
                         {"min_on_ms", millisecondsOf(output.min_on_ns)},
                         {"min_off_ms", millisecondsOf(output.min_off_ns)}};
    writeLine(output, map);
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
