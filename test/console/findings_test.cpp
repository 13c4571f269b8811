#include "wizard/findings.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"
#include "support/axes.h"
#include "support/findings_of.h"
#include "wizard/configuration_file.h"

namespace stepdriver::console {
namespace {

using config::ConfigValue;

std::string text(const ConfigValue& value) { return configurationText(value, {}); }

ConfigValue valueOf(const std::string& source) { return yaml::parse(source, "test"); }

constexpr const char* kAxis = R"(axes:
  x:
    driver: a4988
    steps_per_mm: 80.0
    endstops:
      min: {pin: GPIO23, active_level: high, bias: pull_up}
      max: {pin: GPIO24, active_level: low}
  y: {mm_per_round: 40.0}
  w: {wheel_diameter_mm: 65}
  r: {full_steps_per_round: 200}
)";

TEST(Findings, WithoutAnyTheConfigurationStaysTheSame) {
  EXPECT_EQ(text(corrected(valueOf(kAxis), findingsOf("x"))), text(valueOf(kAxis)));
}

TEST(Findings, TurnTheDirectionRound) {
  Findings findings = findingsOf("x");
  findings.wrong_way = true;
  ConfigValue once = corrected(valueOf(kAxis), findings);
  EXPECT_NE(text(once).find("invert:\n      dir: true"), std::string::npos) << text(once);
  EXPECT_NE(text(corrected(once, findings)).find("dir: false"), std::string::npos);
}

TEST(Findings, SwapTheLinesOfADriverWithOneForEachDirection) {
  Findings findings = findingsOf("x");
  findings.wrong_way = true;
  const std::string axis = "axes:\n  x:\n    pins: {cw: A, ccw: B}\n";
  EXPECT_EQ(text(corrected(valueOf(axis), findings)),
            text(valueOf("axes:\n  x:\n    pins: {cw: B, ccw: A}\n")));
  config::AxisConfig config;
  config.driver.step_inputs = driver::StepInputs::kCwCcw;
  EXPECT_EQ(changesText(findings, config),
            (std::vector<std::string>{
                "x: pins/cw and pins/ccw are swapped, because its plus was your minus"}));
}

TEST(Findings, ReverseTheCoilsOfAMotorOfPhases) {
  Findings findings = findingsOf("x");
  findings.wrong_way = true;
  const std::string axis = "axes:\n  x:\n    pins: {in1: A, in2: B, in3: C, in4: D}\n";
  EXPECT_EQ(text(corrected(valueOf(axis), findings)),
            text(valueOf("axes:\n  x:\n    pins: {in1: D, in2: C, in3: B, in4: A}\n")));
  config::AxisConfig config;
  config.driver.step_inputs = driver::StepInputs::kPhases;
  EXPECT_EQ(changesText(findings, config),
            (std::vector<std::string>{"x: pins/in1 and pins/in4, and pins/in2 and pins/in3, are "
                                      "swapped, because its plus was your minus"}));
}

TEST(Findings, InvertASwitchBeforeTheyAreSwapped) {
  Findings findings = findingsOf("x");
  findings.min_inverted = true;
  findings.switches_swapped = true;
  const std::string wanted = R"(axes:
  x:
    driver: a4988
    steps_per_mm: 80.0
    endstops:
      min: {pin: GPIO24, active_level: low}
      max: {pin: GPIO23, active_level: low, bias: pull_up}
  y: {mm_per_round: 40.0}
  w: {wheel_diameter_mm: 65}
  r: {full_steps_per_round: 200}
)";
  EXPECT_EQ(text(corrected(valueOf(kAxis), findings)), text(valueOf(wanted)));
}

TEST(Findings, MoveASingleSwitchToTheOtherEnd) {
  Findings findings = findingsOf("x");
  findings.switches_swapped = true;
  const ConfigValue after = corrected(
      valueOf("axes: {x: {endstops: {min: {pin: GPIO23, active_level: high}}}}"), findings);
  EXPECT_EQ(text(after),
            text(valueOf("axes: {x: {endstops: {max: {pin: GPIO23, active_level: high}}}}")));
}

TEST(Findings, ScaleTheAxisInItsOwnKey) {
  const auto scaled = [](const std::string& axis, double factor) {
    Findings findings = findingsOf(axis);
    findings.scale = factor;
    return text(corrected(valueOf(kAxis), findings));
  };
  EXPECT_NE(scaled("x", 0.8).find("steps_per_mm: 64.0"), std::string::npos) << scaled("x", 0.8);
  EXPECT_NE(scaled("y", 0.8).find("mm_per_round: 50.0"), std::string::npos) << scaled("y", 0.8);
  EXPECT_NE(scaled("w", 1.3).find("wheel_diameter_mm: 50.0"), std::string::npos);
  EXPECT_NE(scaled("r", 3.0).find("gear_ratio: 3.0"), std::string::npos) << scaled("r", 3.0);
}

TEST(Findings, AreSaidInTheUnitOfTheAxis) {
  Findings findings = findingsOf("x");
  findings.scale = 1.25;
  EXPECT_EQ(changesText(findings, axisConfig("x")),
            std::vector<std::string>{"x: 100 steps per mm instead of 80"});
}

TEST(ConfigurationText, IsReadAsTheSameAgain) {
  const ConfigValue all = valueOf(R"(
a: {yes_word: "yes", number: "017", empty: "", line: "gpiochip0:17", tabbed: "a\tb", hash: "a #b"}
"on": 3
b: [1, 2.5, [true, "off"], {c: d}]
tiny: 1.0e-07
third: 0.3333333333333333
huge: 1.0e+22
whole: 5.0
none: null
)");
  const std::string written = configurationText(all, {"one", "", "two"});
  EXPECT_EQ(written.rfind("# one\n#\n# two\n", 0), 0U);
  const ConfigValue again = valueOf(written);
  EXPECT_EQ(text(again), text(all));
  const auto& map = *again.as<ConfigValue::Map>();
  EXPECT_NE(map.at("whole").as<double>(), nullptr) << "a double stays one";
  EXPECT_EQ(*map.at("third").as<double>(), 1.0 / 3.0);
  EXPECT_EQ(*map.at("a").as<ConfigValue::Map>()->at("yes_word").as<std::string>(), "yes");
  EXPECT_EQ(*map.at("a").as<ConfigValue::Map>()->at("number").as<std::string>(), "017");
}

TEST(ConfigurationFile, TheDriversOwnHasTheSameAxes) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("own_" + std::to_string(getpid()))).string();
  std::ofstream(path) << "# mine\n" << kAxis;
  EXPECT_EQ(readOwnFile(path, valueOf(kAxis), {"x", "y"}), std::string("# mine\n") + kAxis);
  const auto complaint = [&](const std::string& parameters) -> std::string {
    try {
      readOwnFile(path, valueOf(parameters), {"y"});
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(complaint("axes: {x: {driver: other}, y: {mm_per_round: 40.0}}"), "")
      << "only the axes that are checked must be the same";
  EXPECT_NE(complaint("axes: {y: {mm_per_round: 50.0}}")
                .find("axes/y/mm_per_round is 40.0 in the file, but 50.0 in the driver"),
            std::string::npos)
      << complaint("axes: {y: {mm_per_round: 50.0}}");
  EXPECT_NE(complaint("axes: {y: {mm_per_round: 40.0, microsteps: 8}}")
                .find("axes/y/microsteps is missing in the file, but 8 in the driver"),
            std::string::npos);
  EXPECT_NE(complaint("axes: {x: {}}").find("axes/y is a map of 1 in the file, but missing"),
            std::string::npos);
  std::filesystem::remove(path);
  EXPECT_THROW(readOwnFile(path, valueOf(kAxis), {"x"}), Error);
}

TEST(ConfigurationFile, NeverReplacesAnotherWithoutBeingTold) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("wizard_" + std::to_string(getpid()))).string();
  const auto read = [&] {
    std::ifstream file(path);
    return std::string{std::istreambuf_iterator<char>(file), {}};
  };
  std::filesystem::remove(path);
  writeFile(path, "one\n", false);
  EXPECT_EQ(read(), "one\n");
  EXPECT_THROW(checkNewFile(path, false), Error);
  EXPECT_THROW(writeFile(path, "two\n", false), Error);
  EXPECT_EQ(read(), "one\n");
  writeFile(path, "three\n", true);
  EXPECT_EQ(read(), "three\n");
  EXPECT_FALSE(std::filesystem::exists(path + ".new"));
  std::filesystem::remove(path);
  EXPECT_THROW(writeFile(path + "/none/x.yaml", "", false), Error);
}

}  // namespace
}  // namespace stepdriver::console
