#include "sim/motion_judge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

// Steps made by hand, from closed forms: what keeps a limit exactly is never reported, and what
// exceeds it by a tenth is, over many decades of speeds and accelerations.

namespace stepdriver::sim {
namespace {

struct Step {
  std::int64_t time_ns;
  double way;
};

std::int64_t toNs(double seconds) { return std::llround(seconds * 1e9); }

struct Seen {
  int too_fast = 0;
  int too_sudden = 0;
  std::string first;
};

Seen judge(const MotorLimits& limits, const std::vector<Step>& steps) {
  MotionJudge judge(limits);
  Seen seen;
  for (const Step& step : steps) {
    const auto violation = judge.step(step.way, step.time_ns, 0);
    if (violation == Violation::kAboveTopRate) ++seen.too_fast;
    if (violation == Violation::kAboveAcceleration) ++seen.too_sudden;
  }
  seen.first = judge.firstViolation();
  return seen;
}

/// Steps of a move from rest at 0 to rest at `way`, with ramps of the acceleration between the
/// start rate and the rate.
std::vector<Step> trapezoid(double way, double rate, double acceleration, double start = 0.0,
                            double begin = 1.0) {
  const double peak = std::min(rate, std::sqrt(start * start + way * acceleration));
  const double ramp = (peak * peak - start * start) / (2.0 * acceleration);
  const auto risen = [&](double place) {
    return 2.0 * place / (start + std::sqrt(start * start + 2.0 * acceleration * place));
  };
  const double even = (way - 2.0 * ramp) / peak;
  std::vector<Step> steps;
  for (double place = 0.5; place < way; place += 1.0) {
    double time = risen(ramp) + (place - ramp) / peak;
    if (place < ramp) time = risen(place);
    if (place > way - ramp) time = 2.0 * risen(ramp) + even - risen(way - place);
    steps.push_back({toNs(begin + time), 1.0});
  }
  return steps;
}

void append(std::vector<Step>& steps, const std::vector<Step>& more) {
  steps.insert(steps.end(), more.begin(), more.end());
}

std::vector<Step> backwards(std::vector<Step> steps) {
  for (Step& step : steps) step.way = -step.way;
  return steps;
}

double endOf(const std::vector<Step>& steps) {
  return static_cast<double>(steps.back().time_ns) * 1e-9;
}

/// Rates up to the highest that a nanosecond still resolves, ramps of a few steps to many.
void forManyLimits(const std::function<void(const MotorLimits&)>& check) {
  for (double rate = 1e-3; rate < 2e6; rate *= 7.0) {
    for (double ramp = 0.1; ramp < 2e4; ramp *= 11.0) {
      check({rate, rate * rate / (2.0 * ramp), 0.0});
      check({rate, rate * rate / (2.0 * ramp), rate / 5.0});
    }
  }
}

std::string textOf(const MotorLimits& limits) {
  return std::to_string(limits.rate) + " steps/s, " + std::to_string(limits.acceleration) +
         " steps/s^2, from " + std::to_string(limits.start_rate);
}

TEST(MotionJudge, ReportsNothingIfTheLimitsAreKeptExactly) {
  forManyLimits([](const MotorLimits& limits) {
    auto steps = trapezoid(3000.0, limits.rate, limits.acceleration, limits.start_rate);
    const double pause = endOf(steps) + 1.0 / limits.rate;
    append(steps, backwards(trapezoid(700.0, limits.rate, limits.acceleration, limits.start_rate,
                                      pause + 2.0 / std::sqrt(limits.acceleration))));
    const Seen seen = judge(limits, steps);
    EXPECT_EQ(seen.first, "") << textOf(limits);
  });
}

TEST(MotionJudge, ReportsAMoveThatIsATenthTooFast) {
  forManyLimits([](const MotorLimits& limits) {
    const auto steps =
        trapezoid(50'000.0, 1.1 * limits.rate, limits.acceleration, limits.start_rate);
    EXPECT_GT(judge(limits, steps).too_fast, 1'000) << textOf(limits);
  });
}

TEST(MotionJudge, ReportsAMoveWhoseRampsAreATenthTooSteep) {
  forManyLimits([](const MotorLimits& limits) {
    if (limits.start_rate > 0.0) return;
    // Ramps of hundreds of steps: shorter ones are lost in the rounding of places.
    const double ramp = limits.rate * limits.rate / (2.0 * limits.acceleration);
    if (ramp < 500.0) return;
    const auto steps = trapezoid(3.0 * ramp, limits.rate, 1.1 * limits.acceleration);
    EXPECT_GT(judge(limits, steps).too_sudden, 0) << textOf(limits);
  });
}

TEST(MotionJudge, ReportsOneIntervalBelowTheShortest) {
  const MotorLimits limits{4000.0, 40'000.0, 0.0};
  for (const std::int64_t short_ns : {0, 2'000, 100'000, 240'000}) {
    auto steps = trapezoid(2000.0, limits.rate, limits.acceleration);
    steps[1000].time_ns = steps[999].time_ns + short_ns;
    const Seen seen = judge(limits, steps);
    EXPECT_GT(seen.too_fast, 0) << short_ns << " ns";
    EXPECT_NE(seen.first.find("at most 4040 steps/s"), std::string::npos) << seen.first;
  }
}

// Far below the top speed, so that only the acceleration shows it.
TEST(MotionJudge, ReportsStepsThatBunchInASlowMotion) {
  const MotorLimits limits{100'000.0, 40'000.0, 0.0};
  for (const std::int64_t interval_ns : {12'000, 50'000, 200'000}) {
    std::vector<Step> steps;
    std::int64_t time_ns = 1'000'000'000;
    for (int i = 0; i < 100; ++i) {
      time_ns += i >= 50 && i < 54 ? interval_ns : 1'000'000;
      steps.push_back({time_ns, 1.0});
    }
    const Seen seen = judge(limits, steps);
    EXPECT_EQ(seen.too_fast, 0) << interval_ns << " ns";
    EXPECT_GT(seen.too_sudden, 0) << interval_ns << " ns";
    EXPECT_NE(seen.first.find("at most 40400 steps/s^2"), std::string::npos) << seen.first;
  }
}

TEST(MotionJudge, ReportsAStartAtSpeed) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  auto steps = trapezoid(2000.0, limits.rate, limits.acceleration);
  append(steps, {});
  std::int64_t time_ns = steps.back().time_ns + 2'000'000'000;
  for (int i = 0; i < 200; ++i) steps.push_back({time_ns += 200'000, 1.0});
  EXPECT_GT(judge(limits, steps).too_sudden, 0);
}

TEST(MotionJudge, ReportsAReversalAtSpeed) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  std::vector<Step> steps;
  std::int64_t time_ns = 1'000'000'000;
  for (int i = 0; i < 200; ++i) steps.push_back({time_ns += 200'000, i < 100 ? 1.0 : -1.0});
  EXPECT_GT(judge(limits, steps).too_sudden, 0);
}

TEST(MotionJudge, ReportsASlowDownThatIsTooSteepIfTheMotorMovesOn) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  std::vector<Step> steps;
  std::int64_t time_ns = 1'000'000'000;
  for (int i = 0; i < 200; ++i) steps.push_back({time_ns += i < 100 ? 100'000 : 1'000'000, 1.0});
  EXPECT_GT(judge(limits, steps).too_sudden, 0);
}

TEST(MotionJudge, LetsStepsEndAtOnceAndBeginAgainFromRest) {
  forManyLimits([](const MotorLimits& limits) {
    for (const std::size_t kept : {1, 2, 3, 10, 100, 1000, 1500}) {
      auto steps = trapezoid(3000.0, limits.rate, limits.acceleration, limits.start_rate);
      steps.resize(kept);
      for (const bool back : {false, true}) {
        auto again = steps;
        const auto next =
            trapezoid(500.0, limits.rate, limits.acceleration, limits.start_rate, endOf(again));
        append(again, back ? backwards(next) : next);
        EXPECT_EQ(judge(limits, again).first, "")
            << textOf(limits) << ", ended after " << kept << " steps, back: " << back;
      }
    }
  });
}

TEST(MotionJudge, JudgesTheStartAfterStepsThatEndedAtOnce) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  auto steps = trapezoid(3000.0, limits.rate, limits.acceleration);
  steps.resize(1000);
  append(steps, trapezoid(3000.0, limits.rate, 2.0 * limits.acceleration, 0.0, endOf(steps) + 0.1));
  EXPECT_GT(judge(limits, steps).too_sudden, 0);
}

TEST(MotionJudge, LetsTheSpeedJumpByTheStartRate) {
  std::vector<Step> steps;
  std::int64_t time_ns = 1'000'000'000;
  for (int i = 0; i < 300; ++i) {
    steps.push_back({time_ns += 1'000'000, (i / 7) % 2 == 0 ? 1.0 : -1.0});
  }
  EXPECT_EQ(judge({2000.0, 1e3, 1000.0}, steps).first, "");
  EXPECT_NE(judge({2000.0, 1e3, 0.0}, steps).first, "");
}

// As a step that waits for the times of DIR makes all other motors wait too.
TEST(MotionJudge, AllowsForSlidesOfTheTimeline) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  const auto steps = trapezoid(2000.0, limits.rate, limits.acceleration);
  for (const bool knows : {false, true}) {
    MotionJudge judge(limits);
    Slides slides;
    std::int64_t slid_ns = 0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      if (i % 50 == 49) {
        slid_ns += 5'000;
        if (knows) slides.add(6'000);
      }
      judge.step(steps[i].way, steps[i].time_ns + slid_ns, slides.total());
    }
    EXPECT_EQ(judge.firstViolation().empty(), knows) << judge.firstViolation();
  }
}

TEST(MotionJudge, CountsInTheConfiguredMicrosteps) {
  const MotorLimits limits{1600.0, 16'000.0, 0.0};
  auto fine = trapezoid(3000.0, 2.0 * limits.rate, 2.0 * limits.acceleration);
  for (Step& step : fine) step.way = 0.5;
  EXPECT_EQ(judge(limits, fine).first, "");
  auto coarse = trapezoid(3000.0, limits.rate / 16.0, limits.acceleration / 16.0);
  for (Step& step : coarse) step.way = 16.0;
  EXPECT_EQ(judge(limits, coarse).first, "");
  for (Step& step : coarse) step.way = 20.0;
  EXPECT_GT(judge(limits, coarse).too_fast, 0);
}

// Four steps come late, right after each other.
TEST(MotionJudge, AllowsLateStepsToCatchUpAsFarAsTheyMayBeBehind) {
  MotorLimits limits{20'000.0, 40'000.0, 0.0};
  auto steps = trapezoid(20'000.0, limits.rate, limits.acceleration);
  for (std::size_t i = 0; i < 4; ++i) {
    steps[10'000 + i].time_ns = steps[10'004].time_ns - 2'000 * static_cast<int>(4 - i);
  }
  EXPECT_GT(judge(limits, steps).too_fast, 0);
  limits.late = 4.0;
  EXPECT_EQ(judge(limits, steps).first, "");
  limits.late = 3.0;
  EXPECT_GT(judge(limits, steps).too_fast, 0);
}

TEST(MotionJudge, ForgetsWhatWasBeforeAStall) {
  const MotorLimits limits{20'000.0, 40'000.0, 0.0};
  const auto steps = trapezoid(20'000.0, limits.rate, limits.acceleration);
  MotionJudge judge(limits);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (i == 10'000) judge.forget();
    const std::int64_t late_ns = i >= 10'000 ? 2'000'000'000 : 0;
    judge.step(1.0, steps[i].time_ns + late_ns + (i == 10'000 ? 12'500 : 0), 0);
  }
  EXPECT_EQ(judge.firstViolation(), "");
}

}  // namespace
}  // namespace stepdriver::sim
