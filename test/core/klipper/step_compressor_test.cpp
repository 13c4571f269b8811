#include "port/klipper/step_compressor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace stepdriver::klipper {
namespace {

/// Ticks of steps at velocities that change as in motions: constant, ramps, jerks, and stops.
class RandomSteps {
 public:
  RandomSteps(std::uint64_t seed, double clock_hz, std::int64_t closest)
      : random_(seed), clock_(clock_hz), closest_(closest) {}

  std::vector<std::int64_t> next(std::size_t count) {
    std::vector<std::int64_t> ticks;
    while (ticks.size() < count) {
      if (left_-- == 0) choose();
      acceleration_ += jerk_ / velocity_;
      velocity_ = std::clamp(velocity_ + acceleration_ / velocity_, 2.0, 200'000.0);
      time_ += clock_ / velocity_;
      last_ = std::max<std::int64_t>(last_ + closest_, std::llround(time_));
      time_ = std::max(time_, static_cast<double>(last_) - 0.5);
      ticks.push_back(last_);
    }
    return ticks;
  }

 private:
  double uniform(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random_);
  }
  void choose() {
    left_ = static_cast<int>(std::exp(uniform(0.0, 9.0)));
    if (random_() % 4 == 0) velocity_ = std::exp(uniform(0.7, 12.0));
    acceleration_ = random_() % 3 == 0 ? 0.0 : uniform(-1.0, 1.0) * std::exp(uniform(0.0, 14.0));
    jerk_ = random_() % 2 == 0 ? 0.0 : uniform(-1.0, 1.0) * std::exp(uniform(0.0, 18.0));
  }

  std::mt19937_64 random_;
  const double clock_;
  const std::int64_t closest_;
  double time_ = 1000.0;
  std::int64_t last_ = 1000;
  double velocity_ = 100.0;
  double acceleration_ = 0.0;
  double jerk_ = 0.0;
  int left_ = 0;
};

struct Compressed {
  std::size_t runs = 0;
  std::int64_t worst = 0;
};

// Plays all of them by the firmware's formula, one run after the other.
Compressed compressAll(StepCompressor& compressor, const std::vector<std::int64_t>& ticks,
                       std::int64_t& before, std::int64_t error) {
  Compressed result;
  for (std::size_t at = 0; at < ticks.size();) {
    StepRun run;
    const std::size_t steps = compressor.next(before, ticks.data() + at,
                                              std::min<std::size_t>(ticks.size() - at, 2'000), run);
    EXPECT_EQ(steps, run.count);
    EXPECT_TRUE(plays(run, before, ticks.data() + at, error)) << "at step " << at;
    std::int64_t last = before;
    for (std::uint32_t i = 1; i <= run.count; ++i) {
      const std::int64_t tick = tickOf(run, before, i);
      EXPECT_GT(tick, last);
      result.worst = std::max(result.worst, std::abs(tick - ticks[at + i - 1]));
      last = tick;
    }
    before = last;
    at += steps;
    ++result.runs;
    if (testing::Test::HasFailure()) break;
  }
  return result;
}

TEST(StepCompressor, PlaysTenMillionStepsOfRandomMotionsWithinATick) {
  std::size_t steps = 0;
  std::size_t runs = 0;
  for (const double clock : {12e6, 16e6, 180e6}) {
    for (std::uint64_t seed = 0; seed < 7; ++seed) {
      RandomSteps motion(seed, clock, 40);
      StepCompressor compressor(1);
      std::int64_t before = 900;
      for (int i = 0; i < 10; ++i) {
        const std::vector<std::int64_t> ticks = motion.next(50'000);
        const Compressed compressed = compressAll(compressor, ticks, before, 1);
        ASSERT_LE(compressed.worst, 1) << "clock " << clock << ", seed " << seed;
        steps += ticks.size();
        runs += compressed.runs;
      }
    }
  }
  EXPECT_GE(steps, 10'000'000u);
  EXPECT_LT(runs, steps / 3) << "it doesn't compress";
  RecordProperty("runs per 1000 steps", static_cast<int>(1000 * runs / steps));
}

TEST(StepCompressor, NeedsOneRunForAConstantVelocityAndForAnEvenlyChangingInterval) {
  for (const std::int64_t add : {0, 3, -2}) {
    std::vector<std::int64_t> ticks;
    std::int64_t interval = 5'000;
    std::int64_t tick = 0;
    for (int i = 0; i < 1'000; ++i) {
      ticks.push_back(tick += interval);
      interval += add;
    }
    StepCompressor exact(0);
    StepRun run;
    ASSERT_EQ(exact.next(0, ticks.data(), ticks.size(), run), ticks.size()) << add;
    EXPECT_EQ(run.interval, 5'000u);
    EXPECT_EQ(run.add, add);
  }
}

// A ramp from rest is a root, which no run follows for long: up to 89,000 steps/s, a step takes
// 0.15 of a command with an error of a tick.
TEST(StepCompressor, TakesAFewStepsOfASteepRampWithACommand) {
  std::vector<std::int64_t> ticks;
  for (int i = 1; i <= 20'000; ++i) {
    ticks.push_back(std::llround(std::sqrt(2.0 * i / 200'000.0) * 12e6));
  }
  StepCompressor compressor(1);
  std::int64_t before = 0;
  const Compressed compressed = compressAll(compressor, ticks, before, 1);
  EXPECT_LE(compressed.worst, 1);
  EXPECT_LT(compressed.runs, ticks.size() / 6);
}

// The longest run is found: a search over all of them finds none that is longer.
TEST(StepCompressor, MakesTheLongestRunThatThereIs) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 300; ++round) {
    std::vector<std::int64_t> ticks;
    std::int64_t tick = 0;
    for (int i = 0; i < 12; ++i) ticks.push_back(tick += 20 + static_cast<int>(random() % 5));
    const std::int64_t error = static_cast<std::int64_t>(random() % 3);
    StepCompressor compressor(error);
    StepRun run;
    const std::size_t found = compressor.next(0, ticks.data(), ticks.size(), run);
    std::size_t longest = 1;
    for (std::int16_t add = -12; add <= 12; ++add) {
      for (std::uint32_t interval = 15; interval <= 30; ++interval) {
        StepRun other{interval, 1, add};
        while (other.count < ticks.size() &&
               plays({interval, static_cast<std::uint16_t>(other.count + 1), add}, 0, ticks.data(),
                     error)) {
          ++other.count;
        }
        if (plays(other, 0, ticks.data(), error)) {
          longest = std::max<std::size_t>(longest, other.count);
        }
      }
    }
    ASSERT_EQ(found, longest) << "round " << round << ", error " << error;
  }
}

// Both ends of what can be asked of it: intervals from a few ticks to days, across the end of the
// firmware's counter of 32 bits.
TEST(StepCompressor, CrossesTheEndOfTheCounterAndAnyPause) {
  std::mt19937_64 random(9);
  for (int decade = 1; decade <= 13; ++decade) {
    const auto most = static_cast<std::int64_t>(std::pow(10.0, decade));
    StepCompressor compressor(1);
    std::int64_t before = (std::int64_t{1} << 32) - 500;
    std::int64_t tick = before;
    std::vector<std::int64_t> ticks;
    for (int i = 0; i < 5'000; ++i) {
      tick += 5 + static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(most));
      ticks.push_back(tick);
    }
    for (std::size_t at = 0; at < ticks.size();) {
      StepRun run;
      const std::size_t steps = compressor.next(before, ticks.data() + at, ticks.size() - at, run);
      ASSERT_TRUE(plays(run, before, ticks.data() + at, 1)) << "decade " << decade;
      at += steps;
      // A pause of more than the counter's range is one modulo that range.
      const std::int64_t played = tickOf(run, before, run.count);
      const std::int64_t turns =
          std::llround(static_cast<double>(ticks[at - 1] - played) / 4294967296.0);
      before = played + turns * (std::int64_t{1} << 32);
      ASSERT_LE(std::abs(before - ticks[at - 1]), 1);
    }
  }
}

}  // namespace
}  // namespace stepdriver::klipper
