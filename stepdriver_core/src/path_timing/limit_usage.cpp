#include "limit_usage.h"

#include <array>
#include <cstddef>

#include "knot_quintic.h"
#include "reachability.h"

namespace stepdriver::motion {
namespace {

// What a quintic uses of the limits of its axis.
class QuinticUsage {
 public:
  QuinticUsage(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
               double duration)
      : h_(duration),
        v0_(begin.velocity),
        v1_(end.velocity),
        a0_(begin.acceleration),
        curve_(begin, end, duration) {}

  LimitUsage of(const TimingLimits& limits) const {
    double most_jerk = std::max(std::abs(curve_.jerk(0.0)), std::abs(curve_.jerk(1.0)));
    const double level = -curve_.c4() / (5.0 * curve_.c5());
    if (level > 0.0 && level < 1.0) most_jerk = std::max(most_jerk, std::abs(curve_.jerk(level)));
    LimitUsage usage;
    usage.jerk = std::max(usage.jerk, most_jerk / limits.jerk);
    // Bounds that save the search for the extremes of most quintics.
    const double above_ends =
        std::max(std::abs(a0_), std::abs(curve_.acceleration(1.0))) + h_ / 2.0 * most_jerk;
    const double faster = std::max(std::abs(v0_), std::abs(v1_)) + h_ * h_ / 8.0 * most_jerk;
    const bool accelerates = above_ends > std::min(limits.acceleration, limits.deceleration);
    const bool is_fast = faster > limits.speed;
    if (!accelerates && !is_fast) return usage;
    // The acceleration is monotonic from one of these to the next.
    std::array<double, 4> turns{0.0, 1.0, 1.0, 1.0};
    std::size_t count = 1;
    for (const double u : rootsOfJerk()) {
      if (u > turns[count - 1] && u < 1.0) turns[count++] = u;
    }
    turns[count++] = 1.0;
    const int direction = directionOf(v0_, v1_);
    for (std::size_t i = 0; i < count && accelerates; ++i) {
      const double a = curve_.acceleration(turns[i]);
      usage.acceleration =
          std::max(usage.acceleration,
                   std::abs(a) / accelerationTowards(limits, direction, a > 0.0 ? 1 : -1));
    }
    if (!is_fast) return usage;
    const auto take_speed = [&](double u) {
      usage.speed = std::max(usage.speed, std::abs(curve_.velocity(u)) / limits.speed);
    };
    take_speed(0.0);
    take_speed(1.0);
    for (std::size_t i = 0; i + 1 < count; ++i) {
      double low = turns[i];
      double high = turns[i + 1];
      if (curve_.acceleration(low) * curve_.acceleration(high) >= 0.0) continue;
      constexpr int kHalvings = 40;
      for (int k = 0; k < kHalvings; ++k) {
        const double middle = (low + high) / 2.0;
        (curve_.acceleration(low) * curve_.acceleration(middle) > 0.0 ? low : high) = middle;
      }
      take_speed(low);
    }
    return usage;
  }

 private:
  // The roots in increasing order; NaN if there is none.
  std::array<double, 2> rootsOfJerk() const {
    // Solves 10 c5 u^2 + 4 c4 u + c3 = 0.
    const double root =
        std::sqrt(4.0 * curve_.c4() * curve_.c4() - 10.0 * curve_.c5() * curve_.c3());
    const double sum = -(2.0 * curve_.c4() + std::copysign(root, curve_.c4()));
    const double a = sum / (10.0 * curve_.c5());
    const double b = curve_.c3() / sum;
    return {std::min(a, b), std::max(a, b)};
  }

  double h_;
  double v0_;
  double v1_;
  double a0_;
  KnotQuintic curve_;
};

}  // namespace

LimitUsage usageOf(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
                   double duration, const TimingLimits& limits) {
  return QuinticUsage(begin, end, duration).of(limits);
}

}  // namespace stepdriver::motion
