#include "limit_usage.h"

#include <array>
#include <cstddef>

#include "reachability.h"

namespace stepdriver::motion {
namespace {

// A quintic over u from 0 to 1.
class QuinticUsage {
 public:
  QuinticUsage(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
               double duration)
      : h_(duration), v0_(begin.velocity), v1_(end.velocity), a0_(begin.acceleration) {
    const double way = end.position - begin.position;
    const double v0 = h_ * v0_;
    const double v1 = h_ * v1_;
    const double a0 = h_ * h_ * a0_ / 2.0;
    const double a1 = h_ * h_ * end.acceleration / 2.0;
    c3_ = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1;
    c4_ = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1;
    c5_ = 6.0 * way - 3.0 * v0 - 3.0 * v1 - a0 + a1;
  }

  LimitUsage of(const TimingLimits& limits) const {
    double most_jerk = std::max(std::abs(jerk(0.0)), std::abs(jerk(1.0)));
    const double level = -c4_ / (5.0 * c5_);
    if (level > 0.0 && level < 1.0) most_jerk = std::max(most_jerk, std::abs(jerk(level)));
    LimitUsage usage;
    usage.jerk = std::max(usage.jerk, most_jerk / limits.jerk);
    // Bounds that save the search for the extremes of most quintics.
    const double above_ends =
        std::max(std::abs(a0_), std::abs(acceleration(1.0))) + h_ / 2.0 * most_jerk;
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
      const double a = acceleration(turns[i]);
      usage.acceleration =
          std::max(usage.acceleration,
                   std::abs(a) / accelerationTowards(limits, direction, a > 0.0 ? 1 : -1));
    }
    if (!is_fast) return usage;
    const auto take_speed = [&](double u) {
      usage.speed = std::max(usage.speed, std::abs(velocity(u)) / limits.speed);
    };
    take_speed(0.0);
    take_speed(1.0);
    for (std::size_t i = 0; i + 1 < count; ++i) {
      double low = turns[i];
      double high = turns[i + 1];
      if (acceleration(low) * acceleration(high) >= 0.0) continue;
      constexpr int kHalvings = 40;
      for (int k = 0; k < kHalvings; ++k) {
        const double middle = (low + high) / 2.0;
        (acceleration(low) * acceleration(middle) > 0.0 ? low : high) = middle;
      }
      take_speed(low);
    }
    return usage;
  }

 private:
  double velocity(double u) const {
    return v0_ + u * (a0_ * h_ + u * (3.0 * c3_ + u * (4.0 * c4_ + u * 5.0 * c5_)) / h_);
  }
  double acceleration(double u) const {
    return a0_ + u * (6.0 * c3_ + u * (12.0 * c4_ + u * 20.0 * c5_)) / (h_ * h_);
  }
  double jerk(double u) const {
    return (6.0 * c3_ + u * (24.0 * c4_ + u * 60.0 * c5_)) / (h_ * h_ * h_);
  }
  // The roots in increasing order; NaN if there is none.
  std::array<double, 2> rootsOfJerk() const {
    // Solves 10 c5 u^2 + 4 c4 u + c3 = 0.
    const double root = std::sqrt(4.0 * c4_ * c4_ - 10.0 * c5_ * c3_);
    const double sum = -(2.0 * c4_ + std::copysign(root, c4_));
    const double a = sum / (10.0 * c5_);
    const double b = c3_ / sum;
    return {std::min(a, b), std::max(a, b)};
  }

  double h_;
  double v0_;
  double v1_;
  double a0_;
  double c3_ = 0.0;
  double c4_ = 0.0;
  double c5_ = 0.0;
};

}  // namespace

LimitUsage usageOf(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
                   double duration, const TimingLimits& limits) {
  return QuinticUsage(begin, end, duration).of(limits);
}

}  // namespace stepdriver::motion
