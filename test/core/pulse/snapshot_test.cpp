#include "pulse/snapshot.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

#include "pulse/mailbox.h"

namespace stepdriver::pulse {
namespace {

struct Wide {
  std::array<std::uint64_t, 12> words{};
};

TEST(Snapshot, IsNeverReadHalfWritten) {
  Snapshot<Wide> snapshot;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= 200'000; ++i) {
      Wide value;
      value.words.fill(i);
      snapshot.store(value);
    }
    done = true;
  });
  std::uint64_t last = 0;
  while (!done) {
    const Wide value = snapshot.load();
    for (const std::uint64_t word : value.words) ASSERT_EQ(word, value.words[0]);
    ASSERT_GE(value.words[0], last);
    last = value.words[0];
  }
  writer.join();
  EXPECT_EQ(snapshot.load().words[11], 200'000U);
}

TEST(Snapshot, StoresTheBeginningOfAValueAndKeepsTheRest) {
  Snapshot<Wide> snapshot;
  Wide value;
  value.words.fill(1);
  snapshot.store(value);
  value.words.fill(2);
  snapshot.storeFirst<24>(value);
  const auto words = snapshot.load().words;
  EXPECT_EQ(words[0], 2U);
  EXPECT_EQ(words[2], 2U);
  EXPECT_EQ(words[3], 1U);
  EXPECT_EQ(words[11], 1U);
}

TEST(Mailbox, HandsEveryItemOverInOrder) {
  Mailbox<std::uint64_t, 8> mailbox;
  std::thread sender([&] {
    for (std::uint64_t i = 0; i < 100'000;) {
      if (mailbox.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  for (std::uint64_t i = 0; i < 100'000;) {
    if (const std::uint64_t* item = mailbox.front()) {
      EXPECT_EQ(*item, i++);
      mailbox.pop();
    } else {
      std::this_thread::yield();
    }
  }
  sender.join();
}

TEST(Mailbox, SaysWhenItIsFull) {
  Mailbox<int, 2> mailbox;
  EXPECT_TRUE(mailbox.push(1));
  EXPECT_TRUE(mailbox.push(2));
  EXPECT_FALSE(mailbox.push(3));
  mailbox.pop();
  EXPECT_TRUE(mailbox.push(3));
  EXPECT_EQ(*mailbox.front(), 2);
}

}  // namespace
}  // namespace stepdriver::pulse
