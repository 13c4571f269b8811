#include "pattern.h"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver {
namespace {

using Parts = std::vector<std::string_view>;

TEST(Pattern, FindsTheFirstMatchAndOfThoseTheLongest) {
  const std::string text = "b aab aaab";
  EXPECT_EQ(Pattern("a+b?").find(text), Parts{"aab"});
  EXPECT_EQ(Pattern("a|aa").find(text), Parts{"aa"});
  EXPECT_EQ(Pattern("a+").find(text, 3), Parts{"a"});
  EXPECT_EQ(Pattern("a+").find(text, 5), Parts{"aaa"});
  EXPECT_EQ(Pattern("a+").find(text, text.size()), Parts{});
  EXPECT_EQ(Pattern("c").find(text), Parts{});
}

TEST(Pattern, GivesWhatItsParenthesesMatch) {
  const std::string text = "max_speed 1e6";
  const Parts parts = Pattern("([0-9]+)([.][0-9]*)?e([-+]?)([0-9]+)").find(text);
  EXPECT_EQ(parts, (Parts{"1e6", "1", "", "", "6"}));
  EXPECT_EQ(parts[1].data(), text.data() + 10);
  EXPECT_EQ(parts[2].data(), nullptr) << "no part of the match";
  EXPECT_EQ(parts[3].data(), text.data() + 12) << "an empty part of it";
}

TEST(Pattern, TakesTheBeginAndTheEndOfTheWholeText) {
  EXPECT_TRUE(Pattern("^(a|b)?$").matches(""));
  EXPECT_TRUE(Pattern("^(a|b)?$").matches("b"));
  EXPECT_FALSE(Pattern("^(a|b)?$").matches("ab"));
  EXPECT_FALSE(Pattern("^a$").matches("a\n"));
  EXPECT_FALSE(Pattern("^a$").matches("b\na"));
  EXPECT_TRUE(Pattern("^b").find("ab", 1).empty()) << "not where the search begins";
}

TEST(Pattern, TakesTextsOfAnyCharacterAndLength) {
  const std::string long_one(1'000'000, '1');
  EXPECT_FALSE(Pattern("^([-+]?[0-9]+)([.][0-9]*)?[eE]([-+]?)([0-9]+)$").matches(long_one));
  EXPECT_EQ(Pattern("^([0-9]+)$").find(long_one), (Parts{long_one, long_one}));
  EXPECT_TRUE(Pattern("^a[^b]c$").matches(std::string("a\0c", 3)));
  EXPECT_FALSE(Pattern("^a$").matches(std::string("a\0", 2)));
}

TEST(Pattern, SaysWhatIsWrongWithAnExpression) {
  try {
    const Pattern pattern("a(b");
    FAIL() << "it was taken";
  } catch (const stepdriver::Error& error) {
    EXPECT_EQ(std::string(error.what()).find("a(b: "), 0U) << error.what();
  }
}

}  // namespace
}  // namespace stepdriver
