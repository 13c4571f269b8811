#include "port/due_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

namespace stepdriver::pulse {
namespace {

TEST(DueTree, KnowsTheEarliestAndAllWhoAreDueForAnyNumberOfChannels) {
  std::mt19937_64 random(5);
  for (std::size_t count = 0; count <= 33; ++count) {
    SCOPED_TRACE(count);
    DueTree tree(count);
    std::vector<Nanoseconds> dues(count, kNever);
    EXPECT_EQ(tree.earliest(), kNever);
    for (int i = 0; count > 0 && i < 500; ++i) {
      const std::size_t channel = random() % count;
      dues[channel] = random() % 4 == 0 ? kNever : static_cast<Nanoseconds>(random() % 50);
      tree.set(channel, dues[channel]);
      ASSERT_EQ(tree[channel], dues[channel]);
      ASSERT_EQ(tree.earliest(), *std::min_element(dues.begin(), dues.end()));
      const auto now = static_cast<Nanoseconds>(random() % 60);
      std::vector<std::size_t> due;
      tree.collect(now, due);
      std::vector<std::size_t> expected;
      for (std::size_t k = 0; k < count; ++k) {
        if (dues[k] <= now) expected.push_back(k);
      }
      ASSERT_EQ(due, expected);
    }
  }
}

}  // namespace
}  // namespace stepdriver::pulse
