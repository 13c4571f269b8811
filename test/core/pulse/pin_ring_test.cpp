#include "port/pin_ring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "port/record_ring.h"

namespace stepdriver::pulse {
namespace {

using Ring = RecordRing<3>;

// All words of a record tell its number, so that a torn one shows.
Ring::Record recordOf(std::uint64_t number) { return {number, ~number, number * 7}; }

std::vector<std::uint64_t> numbersOf(const Ring::Copy& copy) {
  std::vector<std::uint64_t> numbers;
  for (const Ring::Record& record : copy.records) {
    EXPECT_EQ(record, recordOf(record[0]));
    if (!numbers.empty()) {
      EXPECT_EQ(record[0], numbers.back() + 1);
    }
    numbers.push_back(record[0]);
  }
  return numbers;
}

TEST(RecordRing, HasEveryRecordUntilItIsFull) {
  Ring ring(100);
  EXPECT_TRUE(ring.copy().records.empty());
  for (std::uint64_t i = 0; i < 100; ++i) ring.add(recordOf(i));
  const Ring::Copy copy = ring.copy();
  EXPECT_FALSE(copy.overwritten);
  const auto numbers = numbersOf(copy);
  ASSERT_EQ(numbers.size(), 100U);
  EXPECT_EQ(numbers.front(), 0U);
}

TEST(RecordRing, KeepsTheLatestRecordsWhenItIsFull) {
  Ring ring(100);
  for (std::uint64_t count = 1; count <= 5'000; ++count) {
    ring.add(recordOf(count));
    const Ring::Copy copy = ring.copy();
    const auto numbers = numbersOf(copy);
    ASSERT_GE(numbers.size(), std::min<std::uint64_t>(count, 100)) << count;
    ASSERT_EQ(numbers.back(), count);
    ASSERT_EQ(copy.overwritten, numbers.front() != 1) << count;
  }
}

TEST(RecordRing, ForgetsWhatWasBeforeAClear) {
  Ring ring(100);
  for (std::uint64_t i = 0; i < 300; ++i) ring.add(recordOf(i));
  ring.clear();
  EXPECT_TRUE(ring.copy().records.empty());
  ring.add(recordOf(300));
  const Ring::Copy copy = ring.copy();
  EXPECT_EQ(numbersOf(copy), std::vector<std::uint64_t>{300});
  EXPECT_FALSE(copy.overwritten);
}

TEST(RecordRing, IsCopiedWhileItIsWrittenWithoutATornRecordOrAGap) {
  Ring ring(100);
  std::atomic<bool> ending{false};
  std::thread writer([&] {
    for (std::uint64_t i = 0; !ending; ++i) ring.add(recordOf(i));
  });
  std::uint64_t last = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  for (int copies = 0; copies < 2'000 && std::chrono::steady_clock::now() < end;) {
    const auto numbers = numbersOf(ring.copy());
    if (numbers.empty()) continue;
    EXPECT_GE(numbers.back(), last);
    last = numbers.back();
    ++copies;
  }
  ending = true;
  writer.join();
  EXPECT_GT(last, 200U) << "nothing was overwritten: this tested nothing";
}

class PinRingTest : public testing::Test {
 protected:
  VirtualClock clock_;
};

TEST_F(PinRingTest, HasEachChangeWithItsTimeAndNoWriteOfTheSameLevel) {
  PinRing ring({false, true}, 10);
  ring.add(0, false, 5);
  ring.add(0, true, 10);
  ring.add(1, true, 15);
  ring.add(1, false, 20);
  ring.add(0, false, 20);
  clock_.waitUntil(30);
  const PinRing::Copy copy = ring.copy(clock_);
  ASSERT_EQ(copy.edges.size(), 3U);
  const std::vector<PinRing::Edge> expected{{10, 0, true}, {20, 1, false}, {20, 0, false}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(copy.edges[i].time, expected[i].time);
    EXPECT_EQ(copy.edges[i].output, expected[i].output);
    EXPECT_EQ(copy.edges[i].level, expected[i].level);
  }
  EXPECT_EQ(copy.levels, (std::vector<bool>{false, false}));
}

TEST_F(PinRingTest, HasTheTimesOfAClockThatRunsForYears) {
  PinRing ring({false}, 10);
  constexpr Nanoseconds kYears = 500'000'000'000'000'000;
  for (int i = 0; i < 4; ++i) ring.add(0, i % 2 == 0, kYears + i);
  clock_.waitUntil(kYears + 10);
  const PinRing::Copy copy = ring.copy(clock_);
  ASSERT_EQ(copy.edges.size(), 4U);
  EXPECT_EQ(copy.edges[0].time, kYears);
  EXPECT_EQ(copy.edges[3].time, kYears + 3);
}

// 52 bits of nanoseconds are 52 days: an edge of that age must not appear as a new one.
TEST_F(PinRingTest, ForgetsEdgesWhoseTimeWouldBeAmbiguous) {
  PinRing ring({false}, 10);
  constexpr Nanoseconds kWrap = Nanoseconds{1} << 52;
  ring.add(0, true, 1'000);
  clock_.waitUntil(kWrap + 2'000);
  EXPECT_TRUE(ring.copy(clock_).edges.empty());
  EXPECT_EQ(ring.copy(clock_).levels, std::vector<bool>{true});
  ring.add(0, false, kWrap + 1'500);
  const PinRing::Copy copy = ring.copy(clock_);
  ASSERT_EQ(copy.edges.size(), 1U);
  EXPECT_EQ(copy.edges[0].time, kWrap + 1'500);
}

}  // namespace
}  // namespace stepdriver::pulse
