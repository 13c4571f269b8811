#include "machine/told_levels.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace stepdriver::machine {
namespace {

using Changes = std::vector<std::pair<int, int>>;

Changes told(ToldLevels& levels, const InputReading& reading) {
  Changes changes;
  for (const InputRead& read : levels.differences(reading)) {
    changes.emplace_back(read.input, read.level);
  }
  return changes;
}

TEST(ToldLevels, TellsOnlyWhatDiffers) {
  ToldLevels levels(3);
  EXPECT_EQ(told(levels, {1, {0, 1, 1}}), (Changes{{1, 1}, {2, 1}}));
  EXPECT_EQ(told(levels, {2, {0, 1, 1}}), Changes());
  EXPECT_EQ(told(levels, {3, {1, 1, -5}}), (Changes{{0, 1}, {2, -5}}));
}

// A caller reads the switches, and is held up; meanwhile the watcher reads them after a change.
TEST(ToldLevels, TellsNothingOfAReadingThatBeganBeforeOneThatWasTold) {
  ToldLevels levels(1);
  EXPECT_EQ(told(levels, {2, {1}}), (Changes{{0, 1}}));
  EXPECT_EQ(told(levels, {1, {0}}), Changes());
  EXPECT_EQ(told(levels, {3, {0}}), (Changes{{0, 0}}));
}

// A caller sees a switch bounce that the watcher misses: the watcher's next reading ends that, even
// if it equals the one before.
TEST(ToldLevels, TellsOfALevelThatOnlyACallerHasSeenAway) {
  ToldLevels levels(1);
  EXPECT_EQ(told(levels, {1, {1}}), (Changes{{0, 1}}));
  EXPECT_EQ(told(levels, {2, {0}}), (Changes{{0, 0}}));
  EXPECT_EQ(told(levels, {3, {1}}), (Changes{{0, 1}}));
}

}  // namespace
}  // namespace stepdriver::machine
