#include "wizard/corrected_text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "stepdriver_core/yaml.h"
#include "support/findings_of.h"

namespace stepdriver::console {
namespace {

// Comments, nested keys, flow maps, blank lines, quotes, an order of its own, and a character
// beyond ASCII before all values.
const std::string kFile = R"(# The machine in the µ-lab.
axes:
  x:                          # the long one
    # The board
    driver: a4988
    steps_per_mm: 80.0        # [microsteps/mm]

    endstops:                 # normally closed
      min: {pin: GPIO23, active_level: high}   # pin 16 of the header
      max: {pin: "GPIO24", active_level: 'high', bias: pull_up}   # pin 18
    invert: {enable: true}    # behind an inverter
  y:
    mm_per_round: 40.0
    invert:
      # the motor is mounted upside down
      dir: true   # see above
    endstops:
      max:
        pin: GPIO25   # the blue wire

joint_state_rate: 20.0  # [Hz]
)";

/// The text with one part replaced; the test fails if the part isn't there once.
std::string replaced(std::string text, const std::string& part, const std::string& by) {
  const std::size_t begin = text.find(part);
  EXPECT_NE(begin, std::string::npos) << part;
  EXPECT_EQ(text.find(part, begin + 1), std::string::npos) << part;
  return text.replace(begin, part.size(), by);
}

std::string textAfter(const Findings& findings, const std::string& text = kFile) {
  const CorrectedText result = correctedText(text, {findings});
  EXPECT_TRUE(result.by_hand.empty()) << result.by_hand.at(0);
  return result.text;
}

/// The order of keys makes no difference.
void expectTheSame(const config::ConfigValue& is, const config::ConfigValue& wanted) {
  const auto* const map = is.as<config::ConfigValue::Map>();
  const auto* const wanted_map = wanted.as<config::ConfigValue::Map>();
  if (map == nullptr || wanted_map == nullptr) {
    EXPECT_EQ(yaml::textOf(is), yaml::textOf(wanted));
    return;
  }
  EXPECT_EQ(map->size(), wanted_map->size());
  for (const auto& [key, value] : *wanted_map) {
    ASSERT_EQ(map->count(key), 1U) << key;
    expectTheSame(map->at(key), value);
  }
}

TEST(CorrectedText, WithoutFindingsEveryCharacterStays) {
  EXPECT_EQ(textAfter(findingsOf("x")), kFile);
}

TEST(CorrectedText, ANumberChangesInItsPlaceAndItsCommentStaysInItsColumn) {
  Findings findings = findingsOf("x");
  findings.scale = 1.25;
  EXPECT_EQ(textAfter(findings), replaced(kFile, "steps_per_mm: 80.0        # [microsteps/mm]",
                                          "steps_per_mm: 100.0       # [microsteps/mm]"));
  findings = findingsOf("y");
  findings.scale = 0.8;
  EXPECT_EQ(textAfter(findings), replaced(kFile, "mm_per_round: 40.0", "mm_per_round: 50.0"));
}

TEST(CorrectedText, ADirectionThatIsConfiguredChangesInItsPlace) {
  Findings findings = findingsOf("y");
  findings.wrong_way = true;
  EXPECT_EQ(textAfter(findings),
            replaced(kFile, "dir: true   # see above", "dir: false  # see above"));
}

TEST(CorrectedText, ANewKeyJoinsAFlowMap) {
  Findings findings = findingsOf("x");
  findings.wrong_way = true;
  EXPECT_EQ(textAfter(findings), replaced(kFile, "invert: {enable: true}    # behind",
                                          "invert: {dir: true, enable: true}    # behind"));
}

TEST(CorrectedText, ANewKeyInABlockGetsALineOfItsOwn) {
  const std::string text = "axes:\n  x:   # the first\n    # 80 is right\n    steps_per_mm: 80\n";
  Findings findings = findingsOf("x");
  findings.wrong_way = true;
  EXPECT_EQ(textAfter(findings, text),
            "axes:\n  x:   # the first\n    invert: {dir: true}\n"
            "    # 80 is right\n    steps_per_mm: 80\n");
  EXPECT_EQ(textAfter(findings, "axes:\r\n  x:\r\n    steps_per_mm: 80\r\n"),
            "axes:\r\n  x:\r\n    invert: {dir: true}\r\n    steps_per_mm: 80\r\n");
  findings = findingsOf("y");
  findings.max_inverted = true;
  EXPECT_EQ(textAfter(findings),
            replaced(kFile, "      max:\n        pin: GPIO25",
                     "      max:\n        active_level: low\n        pin: GPIO25"));
}

TEST(CorrectedText, SwappedSwitchesKeepTheirComments) {
  Findings findings = findingsOf("x");
  findings.switches_swapped = true;
  findings.min_inverted = true;
  std::string wanted = replaced(kFile, "min: {pin: GPIO23, active_level: high}",
                                "max: {pin: GPIO23, active_level: low}");
  wanted = replaced(wanted, "max: {pin: \"GPIO24\"", "min: {pin: \"GPIO24\"");
  EXPECT_EQ(textAfter(findings), wanted);
  findings = findingsOf("y");
  findings.switches_swapped = true;
  EXPECT_EQ(textAfter(findings), replaced(kFile, "      max:\n", "      min:\n"))
      << "a single switch moves to the other end";
}

TEST(CorrectedText, AQuotedValueIsReplacedWithItsQuotes) {
  Findings findings = findingsOf("x");
  findings.max_inverted = true;
  EXPECT_EQ(textAfter(findings),
            replaced(kFile, "active_level: 'high', bias", "active_level: low, bias"));
}

TEST(CorrectedText, MeansTheSameAsTheCorrectedParameters) {
  Findings x = findingsOf("x");
  x.wrong_way = x.switches_swapped = x.min_inverted = x.max_inverted = true;
  x.scale = 1.1;
  Findings y = x;
  y.axis = "y";
  y.min_inverted = false;
  const CorrectedText result = correctedText(kFile, {x, y});
  EXPECT_TRUE(result.by_hand.empty());
  const auto wanted = corrected(corrected(yaml::parse(kFile, "file"), x), y);
  expectTheSame(yaml::parse(result.text, "result"), wanted);
}

TEST(CorrectedText, AValueOfAMergedMapIsOverridden) {
  const std::string text =
      "base: &base\n  steps_per_mm: 80.0\naxes:\n  x:\n    <<: *base\n  y:\n    <<: *base\n";
  Findings findings = findingsOf("x");
  findings.scale = 0.5;
  EXPECT_EQ(textAfter(findings, text), replaced(text, "  x:\n", "  x:\n    steps_per_mm: 40.0\n"));
}

TEST(CorrectedText, SaysWhatToWriteByHandIfTheTextCannotBeChanged) {
  // A change of the anchor's text would change y too.
  const std::string text =
      "axes:\n  x: &x\n    steps_per_mm: &steps 80.0\n    endstops: {min: {pin: a, active_level: "
      "low}}\n  y: *x\n";
  Findings findings = findingsOf("y");
  findings.scale = 1.25;
  findings.switches_swapped = true;
  findings.wrong_way = true;
  const CorrectedText result = correctedText(text, {findings});
  EXPECT_EQ(result.text, text) << "nothing is changed by halves";
  EXPECT_EQ(result.by_hand,
            (std::vector<std::string>{"axes/y/endstops/min: remove this key",
                                      "axes/y/endstops/max/active_level: low, "
                                      "axes/y/endstops/max/pin: a",
                                      "axes/y/invert/dir: true", "axes/y/steps_per_mm: 100.0"}));
}

TEST(CorrectedText, EveryShippedConfigurationKeepsItsComments) {
  int files = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(STEPDRIVER_SOURCES "/config")) {
    if (entry.path().extension() != ".yaml") continue;
    std::ifstream stream(entry.path());
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const auto file = yaml::parse(text, entry.path().string());
    const auto axes = file.as<config::ConfigValue::Map>()->find("axes");
    if (axes == file.as<config::ConfigValue::Map>()->end()) continue;
    std::vector<Findings> findings;
    for (const auto& [name, axis] : *axes->second.as<config::ConfigValue::Map>()) {
      if (axis.as<config::ConfigValue::Map>()->count("driver") == 0)
        continue;  // it is an axis of the joystick
      findings.push_back(findingsOf(name));
      findings.back().wrong_way = true;
      if (axis.as<config::ConfigValue::Map>()->count("endstops") > 0) {
        findings.back().switches_swapped = findings.back().min_inverted = true;
        findings.back().max_inverted = true;
      }
      findings.back().scale = 1.25;
    }
    if (findings.empty()) continue;
    ++files;
    const CorrectedText result = correctedText(text, findings);
    EXPECT_TRUE(result.by_hand.empty()) << entry.path() << ": " << result.by_hand.at(0);
    const auto comments = [](const std::string& all) {
      return std::count(all.begin(), all.end(), '#');
    };
    EXPECT_EQ(comments(result.text), comments(text)) << entry.path();
    EXPECT_TRUE(result.text != text) << entry.path();
  }
  EXPECT_GE(files, 3);
}

TEST(CorrectedText, AByteOrderMarkIsNoObstacle) {
  const std::string text =
      "\xEF\xBB\xBF"
      "axes: {x: {steps_per_mm: 80.0}}\n";
  Findings findings = findingsOf("x");
  findings.scale = 1.25;
  EXPECT_EQ(textAfter(findings, text),
            "\xEF\xBB\xBF"
            "axes: {x: {steps_per_mm: 100.0}}\n");
}

}  // namespace
}  // namespace stepdriver::console
