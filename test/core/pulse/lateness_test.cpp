#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>
#include <thread>
#include <vector>

#include "pulse/lateness_record.h"
#include "support/constants.h"

namespace stepdriver::pulse {
namespace {

using test::kSecond;

TEST(LatenessHistogram, HasPercentilesWithinASixteenthAboveTheExactOnes) {
  std::mt19937_64 random(7);
  LatenessHistogram histogram;
  std::vector<Nanoseconds> times;
  for (int i = 0; i < 20'000; ++i) {
    // From nanoseconds to seconds, each decade with the same frequency.
    const double exponent = std::uniform_real_distribution<double>(0.0, 9.5)(random);
    times.push_back(std::llround(std::pow(10.0, exponent)));
    histogram.add(times.back());
  }
  std::sort(times.begin(), times.end());
  const LatenessFigures figures = histogram.figures();
  EXPECT_EQ(figures.count, times.size());
  EXPECT_EQ(figures.max, times.back());
  const auto expect_at = [&times](double part, Nanoseconds figure) {
    const auto rank = static_cast<std::size_t>(std::ceil(part * 20'000.0)) - 1;
    EXPECT_GE(figure, times[rank]) << part;
    EXPECT_LE(figure, times[rank] + times[rank] / 16) << part;
  };
  expect_at(0.5, figures.p50);
  expect_at(0.99, figures.p99);
  expect_at(0.999, figures.p999);
}

TEST(LatenessHistogram, TakesWhatIsBelowNothingOrAboveAMinute) {
  LatenessHistogram histogram;
  EXPECT_EQ(histogram.figures().count, 0U);
  EXPECT_EQ(histogram.figures().p999, 0);
  histogram.add(0);
  histogram.add(-5);
  EXPECT_EQ(histogram.figures().p999, 0);
  histogram.add(3'600 * kSecond);
  EXPECT_EQ(histogram.figures().count, 3U);
  EXPECT_EQ(histogram.figures().max, 3'600 * kSecond);
  EXPECT_GE(histogram.figures().p999, 60 * kSecond);
  histogram.clear();
  EXPECT_EQ(histogram.figures().count, 0U);
  EXPECT_EQ(histogram.figures().max, 0);
}

TEST(LatenessRecord, TellsTheLastWholeSecondAndAllOfIt) {
  LatenessRecord record;
  for (Nanoseconds second = 0; second < 7; ++second) {
    for (int i = 0; i < 10; ++i) record.add(second * kSecond + i * kSecond / 10, second + 1);
    const LatenessFigures last = record.lastSecond(second * kSecond + kSecond / 2);
    EXPECT_EQ(last.count, second == 0 ? 0U : 10U);
    EXPECT_EQ(last.max, second);
    EXPECT_EQ(last.p50, second);
  }
  EXPECT_EQ(record.sinceStart().count, 70U);
  EXPECT_EQ(record.sinceStart().max, 7);
  EXPECT_EQ(record.sinceStart().p50, 4);
  EXPECT_EQ(record.lastSecond(7 * kSecond).count, 10U);
  EXPECT_EQ(record.lastSecond(8 * kSecond).count, 0U) << "no pulse went out in that second";
  record.add(9 * kSecond, 3);
  EXPECT_EQ(record.lastSecond(10 * kSecond).count, 1U) << "of a window that was used before";
}

// A reader never sees fewer values than there were before its read, nor more than after it.
TEST(LatenessRecord, IsReadByAnotherThreadWhileItIsWritten) {
  LatenessRecord record;
  std::atomic<std::uint64_t> written{0};
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < 300'000; ++i) {
      record.add(static_cast<Nanoseconds>(i) * 10'000, static_cast<Nanoseconds>(i % 1000));
      written.store(i + 1, std::memory_order_release);
    }
  });
  std::uint64_t before = 0;
  while (before < 300'000) {
    before = written.load(std::memory_order_acquire);
    const LatenessFigures figures = record.sinceStart();
    ASSERT_GE(figures.count, before);
    ASSERT_LE(figures.p50, figures.p99);
    ASSERT_LE(figures.p99, figures.p999);
    ASSERT_LE(figures.p999, 999);
  }
  writer.join();
  EXPECT_EQ(record.sinceStart().count, 300'000U);
}

}  // namespace
}  // namespace stepdriver::pulse
