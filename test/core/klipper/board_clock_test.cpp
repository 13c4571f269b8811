#include "port/klipper/board_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "port/klipper/transport.h"

namespace stepdriver::klipper {
namespace {

constexpr Nanoseconds kSecond = 1'000'000'000;

/// A board's clock that is too fast, and answers that take their time.
struct TickCounter {
  double frequency = 12e6;
  double start = 4'000'000'000.0;  // shortly before the end of the counter
  std::int64_t ticks(Nanoseconds time) const {
    return static_cast<std::int64_t>(start + static_cast<double>(time) * 1e-9 * frequency);
  }
};

void ask(BoardClock& clock, const TickCounter& board, Nanoseconds now, Nanoseconds there,
         Nanoseconds back) {
  clock.add({now, now + there + back, static_cast<std::uint32_t>(board.ticks(now + there))});
}

TEST(BoardClock, FollowsAClockThatIsTooFastAcrossTheEndOfTheCounter) {
  for (const double ppm : {-300.0, -20.0, 0.0, 50.0, 2'000.0}) {
    TickCounter board;
    board.frequency *= 1.0 + ppm * 1e-6;
    BoardClock clock(12e6);
    std::mt19937_64 random(5);
    for (int i = 0; i < 100; ++i) {
      const auto there = static_cast<Nanoseconds>(100'000 + random() % 200'000);
      const auto back = static_cast<Nanoseconds>(100'000 + random() % 200'000);
      ask(clock, board, i * kSecond, there, back);
      if (i < 3) continue;
      const Nanoseconds time = i * kSecond + kSecond / 2;
      const double off = static_cast<double>(clock.estimateAt(time) - board.ticks(time));
      EXPECT_LE(std::abs(off) / 12e6 * 1e9, 200'000.0) << ppm << " ppm, answer " << i;
      EXPECT_LE(std::abs(off) / 12e6 * 1e9, static_cast<double>(clock.uncertainty()) + 1'000.0);
    }
    EXPECT_NEAR(clock.drift(), ppm, 5.0);
    EXPECT_LE(clock.uncertainty(), 300'000);
  }
}

TEST(BoardClock, CountsAnswersThatCameQuicklyMoreThanThoseThatWereDelayed) {
  const TickCounter board;
  BoardClock clock(12e6);
  for (int i = 0; i < 60; ++i) {
    const bool delayed = i % 3 == 2;
    ask(clock, board, i * kSecond, delayed ? 200 * kMillisecond : 60'000, 60'000);
    if (i < 3) continue;
    const Nanoseconds time = i * kSecond + kSecond / 2;
    const double off = static_cast<double>(clock.estimateAt(time) - board.ticks(time)) / 12e6;
    EXPECT_LE(std::abs(off), 10e-6) << "answer " << i;
  }
}

// Steps at 1 kHz are converted 50 ms ahead while new answers come: their intervals hardly change.
TEST(BoardClock, ConvertsWithoutJumpsWhenTheEstimateChanges) {
  TickCounter board;
  board.frequency *= 1.0 + 80e-6;
  BoardClock clock(12e6);
  ask(clock, board, 0, 900'000, 100'000);
  std::mt19937_64 random(6);
  std::int64_t last = clock.tickAt(0);
  for (int i = 1; i < 60'000; ++i) {
    const Nanoseconds now = i * kMillisecond;
    if (i % 1'000 == 0) {
      ask(clock, board, now, 50'000 + static_cast<Nanoseconds>(random() % 900'000), 100'000);
    }
    const std::int64_t tick = clock.tickAt(now + 50 * kMillisecond);
    // 500 us of a new estimate are made up for in 2 s: 250 ppm of a millisecond are 3 ticks.
    EXPECT_NEAR(static_cast<double>(tick - last), 12'001.0, i == 1 ? 600'001.0 : 8.0) << i;
    if (i > 5'000) {
      const std::int64_t right = board.ticks(now + 50 * kMillisecond);
      EXPECT_LE(std::abs(tick - right), 12'000) << "off by more than a millisecond at " << i;
    }
    last = tick;
  }
}

TEST(BoardClock, TakesTheNewestEstimateAtOnceAtRest) {
  const TickCounter board;
  BoardClock clock(12e6);
  ask(clock, board, 0, 20 * kMillisecond, 0);
  clock.tickAt(0);
  ask(clock, board, kSecond, 10'000, 10'000);
  clock.settle();
  // The first one was 10 ms off.
  const Nanoseconds time = kSecond + kMillisecond;
  EXPECT_NEAR(static_cast<double>(clock.tickAt(time) - board.ticks(time)), 0.0, 4.0);
}

TEST(BoardClock, ConvertsBackAndForth) {
  for (const double frequency : {1e6, 12e6, 520e6}) {
    BoardClock clock(frequency);
    clock.add({0, 2'000, 17});
    clock.settle();
    for (Nanoseconds time = 1'000; time < 100'000'000'000'000; time = 10 * time + 7) {
      const std::int64_t tick = clock.estimateAt(time);
      EXPECT_LE(std::abs(clock.timeOf(tick) - time), static_cast<Nanoseconds>(1e9 / frequency) + 1);
      EXPECT_EQ(clock.widened(static_cast<std::uint32_t>(tick), time), tick);
    }
  }
}

}  // namespace
}  // namespace stepdriver::klipper
