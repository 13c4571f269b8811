#include "printable.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver {
namespace {

TEST(Printable, LeavesEveryTextWithoutControlCharacters) {
  for (const std::string text :
       {"", "x", "my joint", "GPIO17 (pin 11)", "größe", "\xe6\xa8\xaa", "\xe2\x80\xa6", "\xc2"}) {
    EXPECT_TRUE(isPrintable(text)) << text;
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, ShowsControlCharactersAndLineBreaksAsEscapes) {
  for (const auto& [text, shown] : std::vector<std::pair<std::string, std::string>>{
           {"x\n[ERROR] y", "x\\n[ERROR] y"},
           {"\r\t", "\\r\\t"},
           {"a\x1b[2K", "a\\x1b[2K"},
           {std::string("a\0b", 3), "a\\x00b"},
           {"\x7f", "\\x7f"},
           {"a\xc2\x9b"
            "b",
            "a\\xc2\\x9bb"},
           {"\xe2\x80\xa8.\xe2\x80\xa9", "\\xe2\\x80\\xa8.\\xe2\\x80\\xa9"}}) {
    EXPECT_FALSE(isPrintable(text)) << shown;
    EXPECT_EQ(printable(text), shown);
  }
}

TEST(Printable, IsWhatARefusalSays) {
  EXPECT_STREQ(Refused("there is no axis a\nb").what(), "there is no axis a\\nb");
}

}  // namespace
}  // namespace stepdriver
