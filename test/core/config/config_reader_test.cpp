#include "config/config_reader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <locale>

#include "support/config_map.h"
#include "support/constants.h"

namespace stepdriver::config {
namespace {

using test::kInfinity;
using test::kNan;

/// A reader of one key, `key` of `/n`.
class OneKey {
 public:
  OneKey() : value_(ConfigValue::Map{}), reader_(value_, "/n", issues_) {}
  explicit OneKey(ConfigValue value)
      : value_(mapOf({{"key", std::move(value)}})), reader_(value_, "/n", issues_) {}

  ConfigReader* operator->() { return &reader_; }
  Lines lines() const { return linesOf(issues_); }

 private:
  ConfigValue value_;
  std::vector<ConfigIssue> issues_;
  ConfigReader reader_;
};

TEST(ConfigValue, ShowsItselfAsItWasWritten) {
  EXPECT_EQ(ConfigValue().shown(), "nothing");
  EXPECT_EQ(ConfigValue(true).shown(), "true");
  EXPECT_EQ(ConfigValue(-5).shown(), "-5");
  EXPECT_EQ(ConfigValue(1.5).shown(), "1.5");
  EXPECT_EQ(ConfigValue(-5.0).shown(), "-5.0");
  EXPECT_EQ(ConfigValue(0.1).shown(), "0.1");
  EXPECT_EQ(ConfigValue(0.1 + 0.2).shown(), "0.30000000000000004");
  EXPECT_EQ(ConfigValue(1e300).shown(), "1e+300");
  EXPECT_EQ(ConfigValue(kNan).shown(), "nan");
  EXPECT_EQ(ConfigValue(-kInfinity).shown(), "-inf");
  EXPECT_EQ(ConfigValue("abc").shown(), "\"abc\"");
  EXPECT_EQ(ConfigValue(ConfigValue::List{1, 2}).shown(), "a list of 2");
  EXPECT_EQ(ConfigValue(mapOf({{"a", 1}, {"b", 2}, {"c", 3}})).shown(), "a map of 3");
}

TEST(ConfigReader, TakesTheExactTypes) {
  const ConfigValue value = mapOf(
      {{"double", 1.5}, {"int", 3}, {"bool", true}, {"text", "abc"}, {"map", mapOf({{"in", 4}})}});
  std::vector<ConfigIssue> issues;
  ConfigReader reader(value, "/n", issues);
  EXPECT_EQ(reader.number("double", {}), 1.5);
  EXPECT_EQ(reader.integer("int", 1, 3), 3);
  EXPECT_TRUE(reader.boolean("bool"));
  EXPECT_EQ(reader.text("text"), "abc");
  EXPECT_EQ(reader.oneOf("text", {"abc", "def"}), "abc");
  EXPECT_EQ(reader.map("map").integer("in", 0, 9), 4);
  reader.rejectUnknown();
  EXPECT_EQ(linesOf(issues), Lines{});
}

TEST(ConfigReader, TakesAnIntWhereADoubleIsWanted) {
  OneKey key(3);
  EXPECT_EQ(key->number("key", Range::positive()), 3.0);
  EXPECT_EQ(key.lines(), Lines{});
}

TEST(ConfigReader, ConvertsNothingElse) {
  const std::string whole = "is 16.0 (a number with a decimal point), but must be ";
  const ConfigValue list(ConfigValue::List{1, 2});
  {
    OneKey key(16.0);
    EXPECT_EQ(key->integer("key", 1, 32), 0);
    EXPECT_EQ(key->text("key"), "");
    EXPECT_FALSE(key->boolean("key"));
    EXPECT_EQ(key->findOneOf("key", std::vector<int>{1, 16}, Presence::kRequired), std::nullopt);
    EXPECT_EQ(
        key.lines(),
        (Lines{"/n/key: " + whole + "an integer from 1 to 32", "/n/key: " + whole + "a string",
               "/n/key: " + whole + "true or false", "/n/key: " + whole + "an integer: 1 or 16"}));
  }
  {
    OneKey key(true);
    EXPECT_EQ(key->number("key", {}), 0.0);
    EXPECT_EQ(key->integer("key", 0, 1), 0);
    EXPECT_EQ(key->text("key"), "");
    EXPECT_EQ(key.lines(), (Lines{"/n/key: is true (a boolean), but must be a number",
                                  "/n/key: is true (a boolean), but must be an integer from 0 to 1",
                                  "/n/key: is true (a boolean), but must be a string"}));
  }
  {
    OneKey key(1);
    EXPECT_FALSE(key->boolean("key"));
    EXPECT_EQ(key->oneOf("key", {"a", "b"}), "");
    EXPECT_EQ(key.lines(), (Lines{"/n/key: is 1 (an integer), but must be true or false",
                                  "/n/key: is 1 (an integer), but must be a or b"}));
  }
  {
    OneKey key("fast");
    EXPECT_EQ(key->number("key", {}), 0.0);
    EXPECT_FALSE(key->boolean("key"));
    EXPECT_FALSE(key->map("key").isMap());
    EXPECT_EQ(key.lines(), (Lines{"/n/key: is \"fast\" (a string), but must be a number",
                                  "/n/key: is \"fast\" (a string), but must be true or false",
                                  "/n/key: is \"fast\" (a string), but must be a map"}));
  }
  {
    OneKey key(list);
    EXPECT_EQ(key->number("key", {}), 0.0);
    EXPECT_EQ(key.lines(), Lines{"/n/key: is a list of 2, but must be a number"});
  }
  {
    OneKey key{ConfigValue()};
    EXPECT_EQ(key->number("key", {}, 7.0), 7.0);
    EXPECT_EQ(key.lines(), Lines{"/n/key: is nothing, but must be a number"});
  }
}

TEST(ConfigReader, SaysWhatAMissingKeyMustBe) {
  OneKey key;
  EXPECT_EQ(key->number("a", Range::positive()), 0.0);
  EXPECT_EQ(key->number("b", Range::notNegative()), 0.0);
  EXPECT_EQ(key->number("c", {}), 0.0);
  EXPECT_EQ(key->integer("d", 1, 8), 0);
  EXPECT_FALSE(key->boolean("e"));
  EXPECT_EQ(key->text("f"), "");
  EXPECT_EQ(key->oneOf("g", {"x", "y", "z"}), "");
  EXPECT_EQ(key->findOneOf("h", std::vector<int>{1, 2, 4}, Presence::kRequired), std::nullopt);
  EXPECT_EQ(
      key.lines(),
      (Lines{"/n/a: is missing; it must be a number above 0",
             "/n/b: is missing; it must be a number of 0 or more",
             "/n/c: is missing; it must be a number",
             "/n/d: is missing; it must be an integer from 1 to 8",
             "/n/e: is missing; it must be true or false", "/n/f: is missing; it must be a string",
             "/n/g: is missing; it must be x, y or z", "/n/h: is missing; it must be 1, 2 or 4"}));
}

TEST(ConfigReader, TakesTheDefaultOfAMissingKey) {
  OneKey key;
  EXPECT_EQ(key->number("a", Range::positive(), -1.0), -1.0);
  EXPECT_EQ(key->integer("b", 1, 8, 5), 5);
  EXPECT_TRUE(key->boolean("c", true));
  EXPECT_EQ(key->text("d", "abc"), "abc");
  EXPECT_EQ(key->oneOf("e", {"x", "y"}, "y"), "y");
  EXPECT_EQ(key->findNumber("f", {}, Presence::kOptional), std::nullopt);
  EXPECT_TRUE(key->map("g").isMap());
  EXPECT_EQ(key.lines(), Lines{});
}

TEST(ConfigReader, TakesTheDefaultOfAWrongValue) {
  OneKey key("x");
  EXPECT_EQ(key->number("key", {}, 2.0), 2.0);
  EXPECT_EQ(key->integer("key", 0, 9, 5), 5);
  EXPECT_TRUE(key->boolean("key", true));
  EXPECT_EQ(key->oneOf("key", {"abc", "def"}, "def"), "def");
  EXPECT_EQ(key.lines().size(), 4U);
}

TEST(ConfigReader, KeepsNumbersInTheirRange) {
  struct Case {
    ConfigValue value;
    Range range;
    std::string message;  // empty: no issue
  };
  const std::vector<Case> cases{
      {0.0, Range::positive(), "is 0.0, but must be above 0"},
      {-5, Range::positive(), "is -5, but must be above 0"},
      {1e-300, Range::positive(), ""},
      {0, Range::notNegative(), ""},
      {-0.5, Range::notNegative(), "is -0.5, but must be 0 or more"},
      {1.0, {1.0, 2.5}, ""},
      {2.5, {1.0, 2.5}, ""},
      {2.6, {1.0, 2.5}, "is 2.6, but must be from 1 to 2.5"},
      {1.0, {1.0, 2.5, true}, "is 1.0, but must be above 1 and at most 2.5"},
      {3, {-kInfinity, 2.0}, "is 3, but must be at most 2"},
      {kNan, {}, "is nan, but must be a finite number"},
      {kInfinity, Range::positive(), "is inf, but must be a finite number above 0"},
      {-kInfinity, {0.0, 1.0}, "is -inf, but must be a finite number from 0 to 1"}};
  for (const Case& each : cases) {
    OneKey key(each.value);
    const bool right = each.message.empty();
    EXPECT_EQ(key->findNumber("key", each.range, Presence::kRequired).has_value(), right)
        << each.value.shown();
    EXPECT_EQ(key.lines(), right ? Lines{} : Lines{"/n/key: " + each.message});
  }
}

TEST(ConfigReader, KeepsIntegersInTheirRange) {
  constexpr int kMost = std::numeric_limits<int>::max();
  for (const int good : {1, 5, 8}) EXPECT_EQ(OneKey(good)->integer("key", 1, 8), good);
  OneKey low(0);
  low->integer("key", 1, 8);
  low->integer("key", 1, kMost);
  EXPECT_EQ(low.lines(), (Lines{"/n/key: is 0, but must be from 1 to 8",
                                "/n/key: is 0, but must be 1 or more"}));
  OneKey other(3);
  EXPECT_EQ(other->findOneOf("key", std::vector<int>{1, 2, 4}, Presence::kRequired), std::nullopt);
  EXPECT_EQ(other.lines(), Lines{"/n/key: is 3, but must be 1, 2 or 4"});
}

TEST(ConfigReader, NamesTheNearestOfTheAllowedWords) {
  OneKey near("simulatd");
  near->oneOf("key", {"simulated", "libgpiod"});
  EXPECT_EQ(near.lines(),
            Lines{"/n/key: is \"simulatd\", but must be simulated or libgpiod; did you "
                  "mean simulated?"});
  OneKey far("x");
  far->oneOf("key", {"simulated", "libgpiod"});
  EXPECT_EQ(far.lines(), Lines{"/n/key: is \"x\", but must be simulated or libgpiod"});
}

TEST(ConfigReader, SaysHowYamlWantsAnExponent) {
  const auto hint = [](const std::string& text) {
    OneKey key{text.c_str()};
    key->findNumber("key", Range::positive(), Presence::kRequired);
    return key.lines().at(0);
  };
  const std::string is = "/n/key: is \"1e6\" (a string), but must be a number above 0; ";
  EXPECT_EQ(hint("1e6"), is + "write 1.0e+6, because YAML reads 1e6 as text");
  EXPECT_NE(hint("-2.5E3").find("write -2.5e+3,"), std::string::npos) << hint("-2.5E3");
  EXPECT_NE(hint("1.e-3").find("write 1.0e-3,"), std::string::npos) << hint("1.e-3");
  EXPECT_EQ(hint("fast"), "/n/key: is \"fast\" (a string), but must be a number above 0");
  EXPECT_EQ(hint(std::string(100'000, '1')).rfind("/n/key: is \"111", 0), 0U);
}

TEST(ConfigReader, NamesTheNearestKnownKey) {
  struct Case {
    std::string unknown;
    std::string message;
  };
  const std::vector<Case> cases{
      {"max_sped_mm_s", "is not known; did you mean max_speed_mm_s?"},
      {"max_spede_mm_s", "is not known; did you mean max_speed_mm_s?"},
      {"Max_Speed_MM_S", "is not known; did you mean max_speed_mm_s?"},
      {"joitn", "is not known; did you mean joint?"},
      {"jonts", "is not known; did you mean joint?"},
      {"j", "is not known; did you mean joint?"},
      {"max", "is not known; did you mean max_speed_mm_s?"},
      {"mx_spd", "is not known; did you mean max_speed_mm_s?"},
      {"cw", "is not known; known here: joint, max_speed_mm_s and pins"},
      {"colour", "is not known; known here: joint, max_speed_mm_s and pins"}};
  for (const Case& each : cases) {
    const ConfigValue value = mapOf({{each.unknown, 1}, {"pins", 1}});
    std::vector<ConfigIssue> issues;
    ConfigReader reader(value, "/n", issues);
    reader.text("joint", "");
    reader.number("max_speed_mm_s", {}, 0.0);
    reader.allow("pins");
    reader.rejectUnknown();
    EXPECT_EQ(linesOf(issues), Lines{"/n/" + each.unknown + ": " + each.message});
  }
}

TEST(ConfigReader, ListsTheKnownKeysOnce) {
  const ConfigValue value = mapOf({{"colour", 1}, {"price", 2}, {"weight", 3}});
  std::vector<ConfigIssue> issues;
  ConfigReader reader(value, "/n", issues);
  reader.allow("joint");
  reader.allow("pins");
  reader.rejectUnknown();
  EXPECT_EQ(linesOf(issues),
            (Lines{"/n/colour: is not known; known here: joint and pins",
                   "/n/price: is not known either", "/n/weight: is not known either"}));
}

TEST(ConfigReader, RejectsEveryKeyWhereNothingIsKnown) {
  OneKey key(1);
  key->rejectUnknown();
  EXPECT_EQ(key.lines(), Lines{"/n/key: is not known; nothing is allowed here"});
}

TEST(ConfigReader, TellsWhatMayBeLeftOverFromWhatIsOnlyWrong) {
  const ConfigValue value = mapOf({{"a", "x"}, {"b", 1}, {"c", 2}});
  std::vector<ConfigIssue> issues;
  ConfigReader reader(value, "/n", issues);
  reader.number("a", {});
  reader.number("d", {});
  reader.allow("b");
  reader.contradiction("b", "is 1, but must be 2");
  reader.rejectUnknown();
  std::vector<std::string> left_over;
  for (const ConfigIssue& issue : issues) {
    if (issue.may_be_left_over) left_over.push_back(issue.key);
  }
  EXPECT_EQ(issues.size(), 4U);
  EXPECT_EQ(left_over, (std::vector<std::string>{"/n/b", "/n/c"}));
}

TEST(ConfigReader, NamesParametersInFullAtEveryDepth) {
  const ConfigValue value = mapOf({{"a", mapOf({{"b", mapOf({{"c", "x"}})}})}});
  std::vector<ConfigIssue> issues;
  ConfigReader reader(value, "/top", issues);
  ConfigReader inner = reader.map("a").map("b");
  EXPECT_EQ(inner.fullName(""), "/top/a/b");
  inner.number("c", {});
  inner.issue("", "is wrong");
  EXPECT_EQ(linesOf(issues),
            (Lines{"/top/a/b/c: is \"x\" (a string), but must be a number", "/top/a/b: is wrong"}));
}

TEST(ConfigReader, SaysOnceWhatIsNotAMap) {
  const ConfigValue value(5);
  std::vector<ConfigIssue> issues;
  ConfigReader reader(value, "/n", issues);
  reader.number("a", {});
  reader.map("b").text("c");
  reader.rejectUnknown();
  EXPECT_FALSE(reader.has("a"));
  EXPECT_EQ(linesOf(issues), Lines{"/n: is 5 (an integer), but must be a map"});
}

TEST(ConfigReader, WritesNumbersTheSameInEveryLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Comma));
  EXPECT_EQ(ConfigValue(1234.5).shown(), "1234.5");
  std::locale::global(before);
}

}  // namespace
}  // namespace stepdriver::config
