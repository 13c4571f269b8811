// Compares docs/parameters.md with the readers of configurations, in both directions.
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <optional>
#include <ostream>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "config_dump.h"
#include "page.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::docs {
namespace {

using config::ConfigValue;

struct Reading {
  std::string config;
  std::vector<ConfigIssue> issues;
};

/// A node whose parameters are on the page, with a configuration that contains all of its maps.
struct Node {
  const char* name;  ///< for messages
  bool rotary;
  std::function<Reading(const ConfigValue&)> read;
  ConfigValue base;
};

std::ostream& operator<<(std::ostream& out, const Node& node) { return out << node.name; }

Reading readNode(const ConfigValue& tree) {
  Reading reading;
  reading.config = dump(ros_node::readNodeConfig(tree, "", reading.issues));
  return reading;
}

Reading readBase(const ConfigValue& tree) {
  Reading reading;
  reading.config = dump(base::readBaseConfig(tree, "", reading.issues));
  return reading;
}

Reading readJoystick(const ConfigValue& tree) {
  Reading reading;
  reading.config = dump(joystick::readJoystickConfig(tree, "", reading.issues));
  return reading;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size())) {
    text.replace(at, what.size(), by);
  }
  return text;
}

bool isOfLinearAxes(const std::string& key) {
  return key.find("mm_per_round") != std::string::npos ||
         key.find("wheel_diameter_mm") != std::string::npos;
}

/// The name of a linear axis's key on a rotary axis.
std::string rotaryKey(const std::string& key) {
  if (isOfLinearAxes(key)) return key;
  return replaced(replaced(key, "steps_per_mm", "steps_per_degree"), "_mm", "_deg");
}

const std::string kAxisMap = R"(
    driver: drv8825
    pins: {step: A, dir: B, enable: C, sleep: D, reset: E, fault: F, in_position: I}
    chip: {in_position_active: high}
    invert: {dir: false}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
    endstops: {min: {pin: G, active_level: low}, max: {pin: H, active_level: low}}
    brake: {pin: Brake, release_ms: 60.0, engage_ms: 30.0}
    homing: {switch: min, seek_speed_mm_s: 1.0, latch_speed_mm_s: 0.1, pull_off_mm: 1.0, max_travel_mm: 9.0}
    timing: {}
    input_shaper: {type: zv, frequency: 42.0}
)";

Node driver(bool rotary) {
  std::string text = R"(
gpio: {backend: simulated}
realtime: {}
emergency_stop: {pin: Z, active_level: high}
heartbeat: {pin: Y}
motor_power: {pin: W, on_ms: 5.0, feedback: {pin: V, active_level: low}}
outputs: {x: {pin: U}}
boards: {x: {port: /dev/x}}
inputs: {x: {pin: T, active_level: low}}
simulation: {axes: {x: {}}, outputs: {x: {}}, inputs: {x: {axis: x, from_mm: 1.0, to_mm: 2.0}}}
axes:
  x:)" + kAxisMap;
  if (rotary) text = replaced(replaced(text, "steps_per_mm", "steps_per_degree"), "_mm", "_deg");
  return {rotary ? "rotary" : "linear", rotary, readNode, yaml::parse(text, "base")};
}

Node baseNode() {
  return {"base", false, readBase,
          yaml::parse(R"(
separation_mm: 300.0
wheels: {x: {side: left}, y: {side: right}}
steering: {axis: z, wheelbase_mm: 400.0})",
                      "base")};
}

Node joystickNode() {
  return {"joystick", false, readJoystick,
          yaml::parse("axes: {x: {joystick_axis: 0, max_speed_mm_s: 9.0}}", "base")};
}

/// A copy with a value at a path; without a value, the entry at the path is removed.
ConfigValue with(const ConfigValue& tree, const std::string& path, const ConfigValue* value) {
  ConfigValue::Map map =
      tree.as<ConfigValue::Map>() ? *tree.as<ConfigValue::Map>() : ConfigValue::Map{};
  const auto slash = path.find('/');
  const std::string key = path.substr(0, slash);
  if (slash != std::string::npos) {
    map[key] = with(map.count(key) > 0 ? map[key] : ConfigValue(ConfigValue::Map{}),
                    path.substr(slash + 1), value);
  } else if (value != nullptr) {
    map[key] = *value;
  } else {
    map.erase(key);
  }
  return map;
}

const std::string kMotorMap =
    "{pins: {step: A1, dir: A2, enable: A3, fault: A4, in_position: A5}, "
    "endstops: {min: {pin: A6, active_level: low}}}";

/// An axis with two motors that a homing squares.
Node gantry() {
  ConfigValue::Map tree = *driver(false).base.as<ConfigValue::Map>();
  ConfigValue axis = tree.at("axes").as<ConfigValue::Map>()->at("x");
  for (const char* of_a_motor : {"pins", "invert", "endstops"})
    axis = with(axis, of_a_motor, nullptr);
  const ConfigValue motors =
      yaml::parse("left: " + kMotorMap + "\nright: " + replaced(kMotorMap, "A", "B"), "motors");
  const ConfigValue max_skew(4.0);
  axis = with(with(axis, "motors", &motors), "max_skew_mm", &max_skew);
  return {"gantry", false, readNode, with(tree, "axes/x", &axis)};
}

/// Two axes that share motors.
Node corexy() {
  return {"corexy", false, readNode,
          yaml::parse(R"(
gpio: {backend: simulated}
kinematics: {type: corexy, axes: [x, y]}
axes:
  x:
    driver: a4988
    pins: {step: A, dir: B}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
  y:
    driver: a4988
    pins: {step: C, dir: D}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
)",
                      "base")};
}

Node registerChip(const char* name, const std::string& driver, const std::string& place) {
  const std::string axis = R"(
gpio: {backend: simulated}
axes:
  x:
    driver: DRIVER
    pins: {step: A, dir: B}
    tmc: {PLACE, sense_resistor_mohm: 110.0, run_current_a: 0.8}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
)";
  return {name, false, readNode,
          yaml::parse(replaced(replaced(axis, "DRIVER", driver), "PLACE", place), "base")};
}

/// An axis whose chip is on a UART.
Node uartChip() { return registerChip("uart_chip", "tmc2209", "port: /dev/serial0, address: 0"); }

/// An axis whose chip is on SPI.
Node spiChip() { return registerChip("spi_chip", "tmc5160", "spi: /dev/spidev0.0"); }

bool isRegisterChip(const Node& node) {
  return std::string(node.name) == "uart_chip" || std::string(node.name) == "spi_chip";
}

/// An axis that is homed to a block.
Node homing() {
  return {"homing", false, readNode,
          yaml::parse(R"(
gpio: {backend: simulated}
inputs: {x: {pin: T, active_level: low}}
axes:
  x:
    driver: a4988
    pins: {step: A, dir: B}
    microsteps: 16
    steps_per_mm: 80.0
    max_speed_mm_s: 100.0
    acceleration_mm_s2: 500.0
    homing: {kind: block, towards: min, input: x, seek_speed_mm_s: 9.0, pull_off_mm: 1.0, max_travel_mm: 9.0}
)",
                      "base")};
}

/// An output of a PWM chip of the kernel. @param map "pwm" or "servo"
Node pwmOutput(const char* map, const std::string& rest) {
  ConfigValue::Map tree = *homing().base.as<ConfigValue::Map>();
  tree["outputs"] =
      yaml::parse(std::string("x: {") + map + ": {chip: 0, channel: 0" + rest + "}}", "base");
  return {map, false, readNode, tree};
}

bool isPwmOutput(const Node& node) {
  return std::string(node.name) == "pwm" || std::string(node.name) == "servo";
}

ConfigValue scaledByRounds(const Node& node) {
  const ConfigValue steps(200);
  const ConfigValue travel(40.0);
  const ConfigValue by_steps = with(node.base, "axes/x/full_steps_per_round", &steps);
  if (node.rotary) return with(by_steps, "axes/x/steps_per_degree", nullptr);
  return with(with(by_steps, "axes/x/mm_per_round", &travel), "axes/x/steps_per_mm", nullptr);
}

/// A row of the page.
struct Parameter {
  std::string key;
  std::string type;  ///< without its unit
  std::string fallback;
  std::string range;
};

std::vector<Parameter> parametersUnder(const std::string& heading, const std::string& prefix) {
  std::vector<Parameter> parameters;
  for (const Cells& row : tableRows("docs/parameters.md", heading)) {
    if (row.size() != 5) throw std::runtime_error("a row without its five cells: " + row[0]);
    const std::string type = split(row[1], ' ').at(0);
    const std::string name = replaced(replaced(row[0], "<name>", "x"), "<motor>", "left");
    for (const std::string& key : expanded(prefix + name)) {
      if (key != "axes/x/invert/<pin>") {
        parameters.push_back({key, type, row[2], row[3]});
        continue;
      }
      for (const char* pin : {"step", "dir", "cw", "ccw", "enable", "ms1", "ms2", "ms3", "m0", "m1",
                              "m2", "sleep", "reset", "in1", "in2", "in3", "in4"}) {
        parameters.push_back({"axes/x/invert/" + std::string(pin), type, row[2], row[3]});
      }
    }
  }
  return parameters;
}

std::vector<Parameter> parametersOf(const Node& node) {
  if (std::string(node.name) == "joystick") {
    return parametersUnder("The joystick's node", "");
  }
  if (std::string(node.name) == "base") return parametersUnder("The base's node", "");
  if (std::string(node.name) == "gantry") return parametersUnder("Several motors", "axes/x/");
  if (std::string(node.name) == "uart_chip") return parametersUnder("A chip on a UART", "axes/x/");
  if (std::string(node.name) == "spi_chip") {
    std::vector<Parameter> all = parametersUnder("A chip on SPI", "axes/x/");
    std::set<std::string> others{"axes/x/tmc/port", "axes/x/tmc/baud", "axes/x/tmc/address"};
    for (const Parameter& parameter : all) others.insert(parameter.key);
    for (const Parameter& parameter : parametersUnder("A chip on a UART", "axes/x/")) {
      if (others.count(parameter.key) == 0) all.push_back(parameter);
    }
    return all;
  }
  if (std::string(node.name) == "homing") return parametersUnder("Kinds of homing", "axes/x/");
  if (std::string(node.name) == "corexy") return parametersUnder("Axes that share motors", "");
  if (isPwmOutput(node)) {
    const std::string map = std::string("outputs/x/") + node.name + "/";
    std::vector<Parameter> own;
    for (const Parameter& parameter : parametersUnder("A PWM output", "")) {
      if (parameter.key.rfind(map, 0) == 0) own.push_back(parameter);
    }
    return own;
  }
  std::vector<Parameter> all = parametersUnder("The node", "");
  for (const Parameter& parameter : parametersUnder("Outputs and inputs with a name", "")) {
    all.push_back(parameter);
  }
  for (const Parameter& parameter : parametersUnder("Boards", "")) all.push_back(parameter);
  for (const auto& [heading, prefix] :
       {std::pair("An axis", "axes/x/"), std::pair("The simulated rig", "simulation/")}) {
    for (const Parameter& parameter : parametersUnder(heading, prefix)) {
      all.push_back(parameter);
      if (node.rotary) all.back().key = rotaryKey(parameter.key);
    }
  }
  return all;
}

/// The issue with this key; empty if there is none.
std::optional<std::string> issueWith(const Reading& reading, const std::string& key) {
  for (const ConfigIssue& issue : reading.issues) {
    if (issue.key == "/" + key) return issue.message;
  }
  return {};
}

/// The keys that a map may have, from the message about an unknown key.
std::set<std::string> knownIn(const Node& node, const std::string& map) {
  const std::string unknown = map + (map.empty() ? "" : "/") + "qqqqqqqqqqqqqqqqqqqq";
  const ConfigValue value(1);
  const auto message = issueWith(node.read(with(node.base, unknown, &value)), unknown);
  const std::string before = "known here: ";
  const auto at = message ? message->find(before) : std::string::npos;
  if (at == std::string::npos) {
    ADD_FAILURE() << node.name << " says of " << unknown << ": " << message.value_or("nothing");
    return {};
  }
  std::set<std::string> known;
  const std::string list = replaced(message->substr(at + before.size()), " and ", ", ");
  for (const std::string& key : split(list, ',')) known.insert(trimmed(key));
  return known;
}

/// The keys of each map on the page, and the maps.
std::map<std::string, std::set<std::string>> mapsOf(const std::vector<Parameter>& parameters) {
  std::map<std::string, std::set<std::string>> maps;
  for (const Parameter& parameter : parameters) {
    std::string map;
    for (const std::string& key : split(parameter.key, '/')) {
      if (key != "...") maps[map].insert(key);
      map += (map.empty() ? "" : "/") + key;
    }
  }
  for (const char* names : {"axes", "simulation/axes", "wheels", "outputs", "inputs", "boards",
                            "simulation/outputs", "simulation/inputs"}) {
    maps.erase(names);
  }
  return maps;
}

/// The requirement that a reader states for a value.
std::string wantedWords(const Parameter& parameter) {
  if (parameter.type == "line") return "a line";
  if (parameter.type == "boolean") return "true or false";
  if (parameter.type == "list") return "a list of " + parameter.range;
  std::string range = replaced(parameter.range, "`", "");
  const bool is_choice = range != parameter.range || parameter.range.find(',') != std::string::npos;
  if (is_choice) range.replace(range.rfind(", "), 2, " or ");
  if (parameter.type == "text" || parameter.type == "bias") return is_choice ? range : "a string";
  std::string noun = parameter.type == "integer" ? "an integer" : "a number";
  if (range.empty()) return noun;
  if (is_choice) return noun + ": " + range;
  const bool is_adverb = range.rfind("above", 0) == 0 || range.rfind("from", 0) == 0;
  return noun + (is_adverb ? " " : " of ") + range;
}

/// Whether the bases have the key: they have a map of each kind, and their axes are scaled in the
/// first of the ways.
bool isRequired(const Parameter& parameter) {
  static const std::set<std::string> words = {"required",     "required with it", "no homing",
                                              "no switch",    "no button",        "no brake",
                                              "no heartbeat", "no relay",         "no feedback",
                                              "no steering",  "by the mechanics"};
  return words.count(parameter.fallback) > 0;
}

/// The default as a value; no value if the page gives it in words.
std::optional<ConfigValue> literal(const Parameter& parameter) {
  static const std::set<std::string> words = {"none", "as configured", "host, chips, lines",
                                              "the axis's name", "below ROS_HOME"};
  const std::string& text = parameter.fallback;
  if (parameter.type == "list" && words.count(text) > 0) return {};
  if (parameter.type == "text" || parameter.type == "bias") {
    if (words.count(text) > 0 || text.rfind("[the chip's]", 0) == 0) return {};
    return ConfigValue(text);
  }
  const bool is_value = parameter.type == "list" || text == "true" || text == "false" ||
                        text.find_first_not_of("-.0123456789") == std::string::npos;
  if (!is_value) return {};
  return yaml::parse("v: " + text, "default").as<ConfigValue::Map>()->at("v");
}

class ParametersPage : public testing::TestWithParam<Node> {};

TEST_P(ParametersPage, HasEveryKeyThatTheNodeTakesAndNoOther) {
  const std::vector<Parameter> parameters = parametersOf(GetParam());
  for (auto& [map, on_page] : mapsOf(parameters)) {
    // Its other maps are those of every axis.
    if (GetParam().name == std::string("gantry") && map != "axes/x/motors/left") continue;
    if (GetParam().name == std::string("corexy") && map != "kinematics") continue;
    if (isRegisterChip(GetParam()) && map != "axes/x/tmc") continue;
    if (isPwmOutput(GetParam()) && map != std::string("outputs/x/") + GetParam().name) continue;
    if (GetParam().name == std::string("homing")) continue;  // see HomingKinds
    std::set<std::string> expected = on_page;
    // An axis can be of either kind, and the message about keys of both kinds says so.
    const bool is_of_any_kind =
        map == "axes/x" || map == "axes/x/motors/left" || map == "axes/x/tmc";
    for (const std::string& key : on_page) {
      if (is_of_any_kind) expected.insert(rotaryKey(key));
    }
    if (map == "axes/x") {
      for (const Cells& row : tableRows("docs/parameters.md", "An axis")) {
        if (!GetParam().rotary) break;
        for (const std::string& key : expanded(row[0])) expected.insert(split(key, '/').at(0));
      }
    }
    EXPECT_EQ(knownIn(GetParam(), map), expected) << "in the map /" << map;
  }
}

TEST_P(ParametersPage, HasTheTypesAndRangesOfTheReaders) {
  const ConfigValue wrong(ConfigValue::List{});
  for (const Parameter& parameter : parametersOf(GetParam())) {
    if (parameter.type == "map" || (GetParam().rotary && isOfLinearAxes(parameter.key))) continue;
    const auto reading = GetParam().read(with(GetParam().base, parameter.key, &wrong));
    const auto message = issueWith(reading, parameter.key);
    ASSERT_TRUE(message) << parameter.key << ": nobody minds a list";
    EXPECT_NE(
        (*message + "\n")
            .find("must be " + wantedWords(parameter) + (parameter.type == "line" ? "" : "\n")),
        std::string::npos)
        << parameter.key << " " << *message << ", and on the page it is " << wantedWords(parameter);
  }
}

TEST_P(ParametersPage, SaysWhatIsRequired) {
  for (const Parameter& parameter : parametersOf(GetParam())) {
    if (parameter.key.find("...") != std::string::npos) continue;
    const auto reading = GetParam().read(with(GetParam().base, parameter.key, nullptr));
    const auto message = issueWith(reading, parameter.key);
    const bool missing = message && message->rfind("is missing", 0) == 0;
    EXPECT_EQ(missing, isRequired(parameter)) << parameter.key << " " << message.value_or("");
  }
}

TEST_P(ParametersPage, HasTheDefaultsOfTheReaders) {
  int compared = 0;
  for (const Parameter& parameter : parametersOf(GetParam())) {
    if (isRequired(parameter) || parameter.type == "line" || parameter.type == "map") continue;
    const auto value = literal(parameter);
    if (!value) continue;
    const bool unwired = parameter.key.find("invert/m") != std::string::npos ||
                         parameter.key.find("invert/c") != std::string::npos ||
                         parameter.key.find("invert/i") != std::string::npos;
    if (unwired) continue;  // in the bases
    const ConfigValue base =
        parameter.key == "axes/x/gear_ratio" ? scaledByRounds(GetParam()) : GetParam().base;
    const auto without = GetParam().read(with(base, parameter.key, nullptr));
    const auto given = GetParam().read(with(base, parameter.key, &*value));
    ASSERT_TRUE(given.issues.empty()) << parameter.key << " " << given.issues[0].message;
    EXPECT_EQ(given.config, without.config) << parameter.key << ": " << parameter.fallback;
    ++compared;
  }
  const bool has_few = GetParam().name == std::string("corexy") || isRegisterChip(GetParam()) ||
                       isPwmOutput(GetParam()) || GetParam().name == std::string("homing");
  EXPECT_GT(compared, has_few ? -1 : 5);
}

/// Each kind of homing has other keys.
TEST(HomingKinds, HaveTheKeysOnThePageAndNoOthers) {
  std::set<std::string> on_page;
  for (const char* heading : {"An axis", "Kinds of homing"}) {
    for (const Parameter& parameter : parametersUnder(heading, "")) {
      if (parameter.key.rfind("homing/", 0) == 0) on_page.insert(parameter.key.substr(7));
    }
  }
  std::set<std::string> known;
  for (const char* kind : {"limit", "flag", "flag_centre", "index", "block", "direct", "stall"}) {
    Node node = homing();
    const ConfigValue only_kind(ConfigValue::Map{{"kind", kind}});
    node.base = with(node.base, "axes/x/homing", &only_kind);
    for (const std::string& key : knownIn(node, "axes/x/homing")) known.insert(key);
  }
  EXPECT_EQ(known, on_page);
}

std::string nameOf(const testing::TestParamInfo<Node>& info) { return info.param.name; }

INSTANTIATE_TEST_SUITE_P(Nodes, ParametersPage,
                         testing::Values(driver(false), driver(true), gantry(), corexy(), homing(),
                                         uartChip(), spiChip(),
                                         pwmOutput("pwm", ", frequency_hz: 50.0"),
                                         pwmOutput("servo", ""), joystickNode(), baseNode()),
                         nameOf);

}  // namespace
}  // namespace stepdriver::docs
