#include "stepdriver_core/yaml.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

ConfigValue valueOf(const std::string& scalar) {
  const ConfigValue tree = parse("a: " + scalar + "\n", "text");
  return tree.as<ConfigValue::Map>()->at("a");
}

std::string errorOf(const std::string& text) {
  try {
    parse(text, "axis.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(Yaml, TellsIntsAsPyYamlDoes) {
  for (const auto& [text, number] :
       std::vector<std::pair<std::string, int>>{{"0", 0},
                                                {"-7", -7},
                                                {"+7", 7},
                                                {"1_000", 1000},
                                                {"0x1F", 31},
                                                {"017", 15},
                                                {"0b101", 5},
                                                {"-0x10", -16},
                                                {"1:30", 90},
                                                {"-1:00", -60},
                                                {"2147483647", 2147483647},
                                                {"!!int 5", 5}}) {
    const ConfigValue value = valueOf(text);
    ASSERT_NE(value.as<int>(), nullptr) << text << " is " << value.shown();
    EXPECT_EQ(*value.as<int>(), number) << text;
  }
}

TEST(Yaml, TellsDoublesAsPyYamlDoes) {
  for (const auto& [text, number] :
       std::vector<std::pair<std::string, double>>{{"1.5", 1.5},
                                                   {"1.", 1.0},
                                                   {".5", 0.5},
                                                   {"-1_0.25", -10.25},
                                                   {"1.5e+3", 1500.0},
                                                   {"1.0e-3", 0.001},
                                                   {"1:30.5", 90.5},
                                                   {"!!float 2", 2.0},
                                                   {"deg(90)", 1.5707963267948966},
                                                   {"deg(-45.0)", -0.7853981633974483},
                                                   {"rad(1.5)", 1.5},
                                                   {"rad(pi/2)", 1.5707963267948966},
                                                   {"rad(2*pi)", 6.283185307179586}}) {
    const ConfigValue value = valueOf(text);
    ASSERT_NE(value.as<double>(), nullptr) << text << " is " << value.shown();
    EXPECT_DOUBLE_EQ(*value.as<double>(), number) << text;
  }
  EXPECT_TRUE(std::isnan(*valueOf(".nan").as<double>()));
  EXPECT_EQ(*valueOf("-.inf").as<double>(), -INFINITY);
}

TEST(Yaml, WritesNumbersThatAreNotFiniteAsItReadsThem) {
  const std::string text = "a: .nan\nb: .inf\nc: -.inf\n";
  EXPECT_EQ(textOf(parse(text, "axis.yaml")), text);
}

TEST(Yaml, WritesEveryTextSoThatItIsReadAsTheSame) {
  for (const std::string text : {"a\r", "\r", "a\r\nb", "\x7f", "\xc3\xbc\x7f\xf0\x9f\x98\x80",
                                 "\xef\xbf\xbe", "\x1b[2K", "a\tb ", "\xc2\x85", ""}) {
    const ConfigValue value(ConfigValue::Map{{"a", ConfigValue(text)}});
    const ConfigValue again = parse(textOf(value), "axis.yaml");
    const auto* read = again.as<ConfigValue::Map>()->at("a").as<std::string>();
    ASSERT_NE(read, nullptr);
    EXPECT_EQ(*read, text);
  }
}

TEST(Yaml, WritesEveryTextOfThreeCharactersSoThatItIsReadAsTheSame) {
  const std::string characters = "-.?:,#&*!|>'\"%@`{}[]~=<a0 \n\t\\";
  std::vector<std::string> texts = {""};
  for (std::size_t i = 0; texts[i].size() < 3; ++i) {
    for (const char character : characters) texts.push_back(texts[i] + character);
  }
  for (const std::string& text : texts) {
    const ConfigValue root = parse(textOf(text), "axis.yaml");
    ASSERT_NE(root.as<std::string>(), nullptr) << text;
    ASSERT_EQ(*root.as<std::string>(), text);
    const ConfigValue map(ConfigValue::Map{{text, ConfigValue(ConfigValue::List{text, text})}});
    const ConfigValue again = parse(textOf(map), "axis.yaml");
    const auto& [key, value] = *again.as<ConfigValue::Map>()->begin();
    ASSERT_EQ(key, text);
    const auto* list = value.as<ConfigValue::List>();
    ASSERT_TRUE(list != nullptr && list->size() == 2) << text;
    for (const ConfigValue& item : *list) {
      ASSERT_NE(item.as<std::string>(), nullptr) << text;
      ASSERT_EQ(*item.as<std::string>(), text);
    }
  }
}

TEST(Yaml, WritesKeysOfAnyLengthSoThatTheyAreReadAsTheSame) {
  for (const std::string part : {"a", "\x7f", "\xc2\x85", "\xc3\xbc", "\xf0\x9f\x98\x80", "\n"}) {
    std::string key = " ";
    while (key.size() < 1100) {
      key += part;
      const ConfigValue below(ConfigValue::Map{{key, ConfigValue(std::string("b"))}});
      const ConfigValue::List list{ConfigValue(ConfigValue::List{below}), below};
      const ConfigValue value(ConfigValue::Map{{key, below}, {"list", ConfigValue(list)}});
      const std::string text = textOf(value);
      const ConfigValue again = parse(text, "axis.yaml");
      ASSERT_EQ(again.as<ConfigValue::Map>()->count(key), 1U) << key.size();
      ASSERT_EQ(textOf(again), text);
    }
  }
}

TEST(Yaml, TellsBooleansAndNothing) {
  for (const char* text : {"true", "True", "yes", "on", "ON", "!!bool yes"}) {
    ASSERT_NE(valueOf(text).as<bool>(), nullptr) << text;
    EXPECT_TRUE(*valueOf(text).as<bool>()) << text;
  }
  for (const char* text : {"false", "FALSE", "no", "off"}) {
    ASSERT_NE(valueOf(text).as<bool>(), nullptr) << text;
    EXPECT_FALSE(*valueOf(text).as<bool>()) << text;
  }
  for (const char* text : {"", "~", "null"}) EXPECT_TRUE(valueOf(text).isNothing()) << text;
}

TEST(Yaml, LeavesEverythingElseAString) {
  for (const char* text :
       {"x_joint", "GPIO17", "1e3", "1.5e3", "08", "0x", "tRue", "1.2.3", "y", "gpiochip0:17"}) {
    const ConfigValue value = valueOf(text);
    ASSERT_NE(value.as<std::string>(), nullptr) << text << " is " << value.shown();
    EXPECT_EQ(*value.as<std::string>(), text);
  }
  for (const char* text : {"\"17\"", "'17'", "!!str 17"}) {
    ASSERT_NE(valueOf(text).as<std::string>(), nullptr) << text;
    EXPECT_EQ(*valueOf(text).as<std::string>(), "17");
  }
  EXPECT_EQ(*valueOf("'yes'").as<std::string>(), "yes");
}

TEST(Yaml, ResolvesAliasesAndMergeKeys) {
  const ConfigValue tree = parse(
      "pins: &pins {step: A, dir: B}\n"
      "x: {<<: *pins, dir: C}\n"
      "y: *pins\n"
      "z: {<<: [{dir: D}, *pins]}\n",
      "text");
  const auto& map = *tree.as<ConfigValue::Map>();
  const auto pin = [&](const char* axis, const char* name) {
    return *map.at(axis).as<ConfigValue::Map>()->at(name).as<std::string>();
  };
  EXPECT_EQ(pin("x", "step") + pin("x", "dir"), "AC");
  EXPECT_EQ(pin("y", "step") + pin("y", "dir"), "AB");
  EXPECT_EQ(pin("z", "step") + pin("z", "dir"), "AD");
}

TEST(Yaml, KeepsTheOrderOfKeys) {
  const ConfigValue tree = parse("z: 1\nb: {y: 1, a: 2}\na: 3\n", "text");
  EXPECT_EQ(tree.orderedKeys(), (std::vector<std::string>{"z", "b", "a"}));
  EXPECT_EQ(tree.as<ConfigValue::Map>()->at("b").orderedKeys(),
            (std::vector<std::string>{"y", "a"}));
  EXPECT_EQ(parse(textOf(tree), "text").orderedKeys(), tree.orderedKeys());
}

TEST(Yaml, SaysWhereItIsWrong) {
  EXPECT_EQ(errorOf("a: 1\nb: [1, 2\n").rfind("axis.yaml:3:1: ", 0), 0U) << errorOf("b: [1, 2\n");
  EXPECT_EQ(errorOf("a: 1\na: 2\n"), "axis.yaml:2:1: the key a occurs twice");
  EXPECT_EQ(errorOf("a:\n  b: 4294967296\n"),
            "axis.yaml:2:6: 4294967296 is beyond the integers of ROS parameters, -2147483648 to "
            "2147483647");
  EXPECT_EQ(errorOf("a: deg(x)\n"),
            "axis.yaml:1:4: deg(x) isn't an angle: it must be as deg(90.0)");
  EXPECT_EQ(errorOf("a: rad(1+1)\n").rfind("axis.yaml:1:4: rad(1+1) isn't an angle", 0), 0U);
  EXPECT_EQ(errorOf("a: !!int x\n"), "axis.yaml:1:4: x isn't what its tag !!int says");
  EXPECT_EQ(errorOf("a: !mine x\n"), "axis.yaml:1:4: the tag !mine can't be a ROS parameter");
  EXPECT_EQ(errorOf("[1]: x\n"), "axis.yaml:1:1: a key must be a word");
  EXPECT_EQ(errorOf("a: {on: x}\n"),
            "axis.yaml:1:5: the key on is read as true, but must be a word: put it in quotes");
  EXPECT_EQ(errorOf("7: x\n").rfind("axis.yaml:1:1: the key 7 is read as 7", 0), 0U);
  EXPECT_EQ(errorOf("'on': x\n'7': y\n"), "none");
  EXPECT_EQ(errorOf("a: 1\n---\nb: 2\n").rfind("axis.yaml:3:1: a second document", 0), 0U);
  EXPECT_NE(errorOf("a: &a [*a]\n").find("alias for a node that contains it"), std::string::npos);
}

TEST(Yaml, NamesATabThatIndents) {
  for (const std::string text :
       {"axes:\n\tx:\n\t\tdriver: a4988\n", "axes:\n  x:\n\tdriver: a4988\n",
        "axes:\n  x:\n    pins:\n    \tstep: a\n", "\ta: 1\n",
        "axes:\n  x:\n    driver: a4988\n\tpins: {step: a}\n"}) {
    try {
      yaml::parse(text, "f.yaml");
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find(": the line is indented by a tab; YAML takes only spaces"),
                std::string::npos)
          << text << what;
    }
  }
}

// YAML::LoadAll() would return empty documents for ever.
TEST(Yaml, RefusesATextThatContinuesWhereItMustEnd) {
  const std::string why = "a second document begins here; only one is allowed";
  EXPECT_EQ(errorOf(", a"), "axis.yaml:1:1: " + why);
  EXPECT_EQ(errorOf("{a: 1}, b"), "axis.yaml:1:7: " + why);
}

TEST(Yaml, SaysWhichFileCannotBeRead) {
  for (const std::string path : {"/nowhere/at/all.yaml", "/"}) {
    try {
      load(path);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(path + ": ", 0), 0U) << error.what();
    }
  }
}

TEST(Yaml, RefusesAliasesThatStandForTooMuch) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  // A list of maps is allowed below << only.
  std::string merges = "a0: {<<: &a0 [{k: x}, {k: x}]}\n";
  for (int i = 1; i < 40; ++i) {
    const std::string name = std::to_string(i);
    const std::string two = "[*a" + std::to_string(i - 1) + ", *a" + std::to_string(i - 1) + "]";
    bomb.append("a").append(name).append(": &a").append(name).append(" ").append(two).append("\n");
    merges.append("a").append(name).append(": {<<: &a").append(name).append(" ").append(two);
    merges.append("}\n");
  }
  const std::string wanted =
      "there are more than 20000 values up to here, each alias counted as the values that it "
      "stands for";
  EXPECT_NE(errorOf(bomb).find(wanted), std::string::npos) << errorOf(bomb);
  EXPECT_NE(errorOf(merges).find(wanted), std::string::npos) << errorOf(merges);
  EXPECT_NE(errorOf("a: {<<: &a [*a]}\n").find("alias for a node that contains it"),
            std::string::npos);
}

TEST(Yaml, RefusesWhatIsNoTextAndTellsWhere) {
  const std::string why = " is no text: a configuration is UTF-8 without control characters";
  EXPECT_EQ(errorOf({"\x01\0\0\0\0\0\0\x0f", 8}), "axis.yaml:1:1: the byte 0x01" + why);
  EXPECT_EQ(errorOf({"a: b\0c", 6}), "axis.yaml:1:5: the byte 0x00" + why);
  EXPECT_EQ(errorOf("a: 1\nm\xc3\xbc: \x1b[2J"), "axis.yaml:2:5: the byte 0x1b" + why);
  EXPECT_EQ(errorOf("\xff\xfe"
                    "a"),
            "axis.yaml:1:1: the byte 0xff" + why);
  for (const char* not_utf8 :
       {"\x80", "\xc3", "\xc0\xaf", "\xe0\x9f\xbf", "\xed\xa0\x80", "\xe2\x82", "\xf0\x8f\xbf\xbf",
        "\xf4\x90\x80\x80", "\xf5\x80\x80\x80"}) {
    EXPECT_NE(errorOf(not_utf8).find(why), std::string::npos) << testing::PrintToString(not_utf8);
  }
  for (const char* text : {"\xef\xbb\xbf"
                           "a: b",
                           "a: \xc3\xbc\xe2\x82\xac\xed\x9f\xbf\xf0\x9f\x98\x80",
                           "a: b\t# \xc2\x85", "a: \"\\0\\x1b\""}) {
    EXPECT_EQ(errorOf(text), "none");
  }
}

TEST(Yaml, RefusesTooLongAText) {
  const auto text = [](std::size_t size) { return "a: " + std::string(size, '1') + "x\n"; };
  EXPECT_EQ(errorOf(text(4095)), "none");
  EXPECT_EQ(errorOf(text(4096)),
            "axis.yaml:1:4: a text of 4097 characters is too long, at most 4096 are allowed");
}

TEST(Yaml, RefusesTooLargeAFileAndReadsNoMoreOfIt) {
  EXPECT_EQ(errorOf(std::string((1U << 20U) + 1, '\n')),
            "axis.yaml: is larger than 1048576 bytes, the most that a configuration may have");
  EXPECT_EQ(errorOf(std::string(1U << 20U, '\n')), "none");
  try {
    load("/dev/zero");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "/dev/zero: is larger than 1048576 bytes, the most that a configuration may have");
  }
}

TEST(Yaml, ForgesNoLineOfAMessage) {
  EXPECT_EQ(errorOf("\"x\\ny\": 1\n\"x\\ny\": 2\n"), "axis.yaml:2:1: the key x\\ny occurs twice");
}

TEST(Yaml, OfAnEmptyFileIsAnEmptyMap) {
  for (const char* text : {"", "# nothing\n", "---\n"}) {
    const ConfigValue tree = parse(text, "text");
    ASSERT_NE(tree.as<ConfigValue::Map>(), nullptr) << text;
    EXPECT_TRUE(tree.as<ConfigValue::Map>()->empty());
  }
}

class ConfigurationFile : public testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }

  const std::string& file(const std::string& text) {
    std::ofstream(path_) << text;
    return path_;
  }

  static constexpr const char* kAxis =
      "axes: {x: {driver: a4988, pins: {step: S, dir: D}, microsteps: 16, steps_per_mm: 80.0,\n"
      "  max_speed_mm_s: 100.0, acceleration_mm_s2: 500.0,\n"
      "  endstops: {min: {pin: A, active_level: low}, max: {pin: B, active_level: low}}}}\n";

  const std::string path_ =
      testing::TempDir() + "stepdriver_yaml_" + std::to_string(getpid()) + ".yaml";
};

TEST_F(ConfigurationFile, GivesAMachineWhateverOfTheNodeIsInIt) {
  const setup::MachineConfig config = readFile(
      file(std::string(kAxis) + "gpio: {backend: simulated}\n"
                                "realtime: {policy: enforce, max_lateness_ms: 2.0}\n"
                                "joint_state_rate: 10.0\njog_timeout: 1.0\nhardware_id: h\n"
                                "urdf_limits: false\ntrajectory: {allow_slower: true}\n"
                                "simulation: {speed: 0.0}\n"));
  EXPECT_EQ(config.backend, setup::GpioBackend::kSimulated);
  ASSERT_EQ(config.axes.size(), 1U);
  EXPECT_EQ(config.axes[0].name, "x");
  EXPECT_EQ(config.simulation.speed, 0.0);
  EXPECT_TRUE(config.options().enforce);
  EXPECT_DOUBLE_EQ(config.options().max_lateness, 0.002);
}

TEST_F(ConfigurationFile, ListsEveryMistakeOfAMachine) {
  try {
    readFile(file(
        "gpio: {backend: gpio}\nstate_file: relative\nspeed: 1\naxes: {x: {driver: a4989}}\n"));
    FAIL();
  } catch (const ConfigError& error) {
    std::vector<std::string> keys;
    for (const ConfigIssue& issue : error.issues()) keys.push_back(issue.key);
    for (const char* key : {"gpio/backend", "state_file", "speed", "axes/x/driver"}) {
      EXPECT_NE(std::find(keys.begin(), keys.end(), key), keys.end()) << key << "\n"
                                                                      << error.what();
    }
  }
}

TEST_F(ConfigurationFile, IsRefusedIfItsRigCannotBeBuilt) {
  const std::string crossed = "simulation: {axes: {x: {min_switch_mm: 9.0, max_switch_mm: 1.0}}}\n";
  EXPECT_THROW(readFile(file(kAxis + crossed), setup::BackendChoice::kSimulated), ConfigError);
}

TEST_F(ConfigurationFile, MayDescribeTheRigOfOneMotor) {
  const std::string gantry =
      "axes: {y: {driver: a4988, microsteps: 16, steps_per_mm: 80.0, max_speed_mm_s: 100.0,\n"
      "  acceleration_mm_s2: 500.0, motors: {left: {pins: {step: A, dir: B}},\n"
      "  right: {pins: {step: C, dir: D}}}}}\n"
      "simulation: {axes: {y: {start_mm: 1.0, bounces: 3, lose_every: 7, motors: {";
  const auto read = [&](const std::string& motor) {
    return readFile(file(gantry + motor + "}}}}\n"), setup::BackendChoice::kSimulated).simulation;
  };
  const setup::SimulatedAxis y = read("right: {start_mm: 4.0}").axes.at("y");
  EXPECT_EQ(y.ofMotor("left").start, 1.0);
  EXPECT_EQ(y.ofMotor("left").faults.lose_every, 7);
  EXPECT_EQ(y.ofMotor("right").start, 4.0);
  EXPECT_EQ(y.ofMotor("right").bounces, 3);
  EXPECT_EQ(y.ofMotor("right").faults.lose_every, 0);
  EXPECT_THROW(read("middle: {start_mm: 4.0}"), ConfigError);
  EXPECT_THROW(read("right: {start_cm: 4.0}"), ConfigError);
}

TEST_F(ConfigurationFile, MayDescribeTheMotorsOfTheRig) {
  const auto read = [&](const std::string& motor) {
    return readFile(
        file(std::string(kAxis) + "simulation: {axes: {x: {motor: {" + motor + "}}}}\n"),
        setup::BackendChoice::kSimulated);
  };
  const auto motor = [&](const std::string& text) {
    const setup::MachineConfig config = read(text);
    return setup::motorOf(config.axes, 0, config.simulation.axes.at("x").motor);
  };
  const sim::MotorSpec known = motor(
      "pole_pairs: 100, holding_torque_nm: 0.25, rotor_inertia_g_cm2: 35.0, "
      "load_inertia_g_cm2: 15.0, friction_nm: 0.02, damping: 0.05");
  EXPECT_EQ(known.pole_pairs, 100);
  EXPECT_EQ(known.holding_torque, 0.25) << "also if that is too little";
  EXPECT_NEAR(known.inertia, 50e-7, 1e-18);
  EXPECT_EQ(known.friction, 0.02);
  EXPECT_EQ(known.damping, 0.05);
  EXPECT_EQ(motor("").holding_torque, 0.3);
  EXPECT_EQ(motor("friction_nm: 1.0").holding_torque, 4.0);
  for (const char* wrong :
       {"holding_torque: 0.3", "holding_torque_nm: 0.0", "holding_torque_nm: 1.1e+6",
        "rotor_inertia_g_cm2: 0.0", "load_inertia_g_cm2: -1.0", "friction_nm: -0.1", "damping: 0.0",
        "damping: 11.0", "pole_pairs: 0", "pole_pairs: 1001", "pole_pairs: 50.0"}) {
    EXPECT_THROW(read(wrong), ConfigError) << wrong;
  }
}

}  // namespace
}  // namespace stepdriver::yaml
