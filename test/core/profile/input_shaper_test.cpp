#include "profile/input_shaper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "support/constants.h"

namespace stepdriver::motion {
namespace {

using test::kPi;

/// What remains of an oscillation after the last impulse, as a part of that after one impulse at
/// the end: the closed form of Singer and Seering.
double residual(const InputShaper& shaper, double frequency, double damping) {
  const double w = 2.0 * kPi * frequency;
  const std::complex<double> pole(-damping * w, w * std::sqrt(1.0 - damping * damping));
  const double end = static_cast<double>(shaper.durationNs()) * 1e-9;
  std::complex<double> sum;
  for (const Impulse& impulse : shaper.impulses()) {
    const double left = end - static_cast<double>(impulse.delay_ns) * 1e-9;
    sum += impulse.part * std::exp(pole * left);
  }
  return std::abs(sum);
}

double worst(const InputShaper& shaper, double frequency, double damping, double spread) {
  double most = 0.0;
  for (double f = 1.0 - spread; f <= 1.0 + spread; f += 0.001) {
    most = std::max(most, residual(shaper, f * frequency, damping));
  }
  return most;
}

const std::vector<double> kDampings = {0.0, 0.01, 0.05, 0.1, 0.2, 0.4};

TEST(InputShaper, PartsArePositiveAndTheirSumIsExactlyOne) {
  for (const double damping : kDampings) {
    for (const double frequency : {0.7, 13.0, 42.0, 333.3}) {
      const InputShaper two = InputShaper::twoHumpEi(frequency, damping);
      for (const InputShaper& shaper :
           {InputShaper::zv(frequency, damping), InputShaper::mzv(frequency, damping),
            InputShaper::ei(frequency, damping), two,
            two.with(InputShaper::twoHumpEi(1.7 * frequency, damping))}) {
        double sum = 0.0;
        std::int64_t before = -1;
        for (const Impulse& impulse : shaper.impulses()) {
          EXPECT_GT(impulse.part, 0.0);
          EXPECT_GT(impulse.delay_ns, before);
          before = impulse.delay_ns;
          sum += impulse.part;
        }
        EXPECT_EQ(sum, 1.0);
        EXPECT_EQ(shaper.impulses().front().delay_ns, 0);
        EXPECT_LE(shaper.impulses().size(), InputShaper::kMostImpulses);
      }
    }
  }
}

TEST(InputShaper, ZvIsTheClosedForm) {
  const InputShaper even = InputShaper::zv(50.0, 0.0);
  ASSERT_EQ(even.impulses().size(), 2U);
  EXPECT_EQ(even.impulses()[0].part, 0.5);
  EXPECT_EQ(even.durationNs(), 10'000'000);
  const double k = std::exp(-0.1 * kPi / std::sqrt(0.99));
  const InputShaper damped = InputShaper::zv(50.0, 0.1);
  EXPECT_NEAR(damped.impulses()[1].part, k / (1.0 + k), 1e-15);
  EXPECT_EQ(damped.durationNs(), std::llround(1e7 / std::sqrt(0.99)));
}

TEST(InputShaper, LittleOfTheOscillationIsLeft) {
  for (const double damping : kDampings) {
    SCOPED_TRACE(damping);
    EXPECT_LT(residual(InputShaper::zv(42.0, damping), 42.0, damping), 1e-6);
    EXPECT_LT(residual(InputShaper::mzv(42.0, damping), 42.0, damping), 1e-6);
    EXPECT_LE(residual(InputShaper::ei(42.0, damping), 42.0, damping), 0.05 + 1e-6);
    EXPECT_LE(residual(InputShaper::twoHumpEi(42.0, damping), 42.0, damping), 0.05 + 1e-6);
    EXPECT_LE(worst(InputShaper::ei(42.0, damping), 42.0, damping, 0.1), 0.0501);
    EXPECT_LE(worst(InputShaper::twoHumpEi(42.0, damping), 42.0, damping, 0.1), 0.0501);
  }
  EXPECT_LE(worst(InputShaper::mzv(42.0, 0.0), 42.0, 0.0, 0.05), 0.052);
  EXPECT_LE(worst(InputShaper::ei(42.0, 0.0), 42.0, 0.0, 0.19), 0.0501);
  EXPECT_LE(worst(InputShaper::twoHumpEi(42.0, 0.0), 42.0, 0.0, 0.35), 0.0501);
  // Without any tolerance for the frequency, ZV leaves three times as much.
  EXPECT_GT(worst(InputShaper::zv(42.0, 0.0), 42.0, 0.0, 0.1), 0.15);
}

// They trade what is left near their frequency for a wider range of it.
TEST(InputShaper, EiLeavesTheFivePercentThatItAllows) {
  EXPECT_NEAR(residual(InputShaper::ei(42.0, 0.0), 42.0, 0.0), 0.05, 1e-6);
  EXPECT_LT(residual(InputShaper::twoHumpEi(42.0, 0.0), 42.0, 0.0), 1e-6);
  EXPECT_NEAR(worst(InputShaper::twoHumpEi(42.0, 0.0), 42.0, 0.0, 0.3), 0.05, 1e-4);
}

TEST(InputShaper, OneForTwoOscillationsStopsBoth) {
  const InputShaper both = InputShaper::zv(30.0, 0.02).with(InputShaper::mzv(71.0, 0.1));
  EXPECT_EQ(both.impulses().size(), 6U);
  EXPECT_LT(residual(both, 30.0, 0.02), 1e-6);
  EXPECT_LT(residual(both, 71.0, 0.1), 1e-6);
  EXPECT_EQ(both.durationNs(),
            InputShaper::zv(30.0, 0.02).durationNs() + InputShaper::mzv(71.0, 0.1).durationNs());
  // Parts at the same time are one part.
  EXPECT_EQ(InputShaper::zv(30.0, 0.0).with(InputShaper::zv(30.0, 0.0)).impulses().size(), 3U);
}

}  // namespace
}  // namespace stepdriver::motion
