#include "keys.h"

#include <gtest/gtest.h>

#include <string>

namespace stepdriver::console {
namespace {

TEST(Keys, StopWhatMoves) {
  EXPECT_EQ(commandOf(' ')->action, Action::kEmergencyStop);
  EXPECT_EQ(commandOf('s')->action, Action::kStop);
  EXPECT_EQ(commandOf(kKeyEscape)->action, Action::kStop);
}

TEST(Keys, JogInTheirDirectionAtTheirSpeed) {
  struct Wanted {
    Key key;
    int direction;
    JogSpeed speed;
  };
  for (const Wanted& wanted : {Wanted{kKeyLeft, -1, JogSpeed::kSlow},
                               {kKeyRight, 1, JogSpeed::kSlow},
                               {',', -1, JogSpeed::kSlow},
                               {'.', 1, JogSpeed::kSlow},
                               {kKeyShiftLeft, -1, JogSpeed::kFast},
                               {kKeyShiftRight, 1, JogSpeed::kFast},
                               {'<', -1, JogSpeed::kFast},
                               {'>', 1, JogSpeed::kFast}}) {
    const auto command = commandOf(wanted.key);
    ASSERT_TRUE(command) << wanted.key;
    EXPECT_EQ(command->action, Action::kJog) << wanted.key;
    EXPECT_EQ(command->direction, wanted.direction) << wanted.key;
    EXPECT_EQ(command->speed, wanted.speed) << wanted.key;
  }
}

TEST(Keys, HoldResumeAndChangeTheSpeed) {
  EXPECT_EQ(commandOf('p')->action, Action::kHold);
  EXPECT_EQ(commandOf('c')->action, Action::kResume);
  EXPECT_EQ(commandOf('[')->action, Action::kSlower);
  EXPECT_EQ(commandOf(']')->action, Action::kFaster);
}

TEST(Keys, ChooseAnAxisByItsNumberFromOne) {
  EXPECT_EQ(commandOf('1')->index, 0);
  EXPECT_EQ(commandOf('9')->index, 8);
  EXPECT_FALSE(commandOf('0'));
}

// A terminal's sequences for keys that aren't known here end in one of them.
TEST(Keys, CapitalLettersMeanNothing) {
  for (const char letter : std::string("ABCDEFGHIJKLMNOPQRSTUVWXYZ")) {
    EXPECT_FALSE(commandOf(letter)) << letter;
  }
}

}  // namespace
}  // namespace stepdriver::console
