#include "line_motion.h"

#include <algorithm>
#include <cmath>

#include "math/double_double.h"
#include "point_to_point/end_state.h"
#include "point_to_point/motion_limits.h"
#include "point_to_point/phases.h"
#include "point_to_point/velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kRoundingOfLine = 1e-9;  // of a length or a speed
constexpr int kMostSearchSteps = 100;

// Up to the peak and, backwards in time, up to it from the end.
class LinePlanner {
 public:
  LinePlanner(double length, double begin_speed, double end_speed, const LineLimits& limits)
      : length_(length), begin_(begin_speed), end_(end_speed) {
    up_.max_speed = down_.max_speed = limits.speed;
    up_.acceleration = down_.deceleration = limits.acceleration;
    up_.deceleration = down_.acceleration = limits.deceleration;
    up_.jerk = down_.jerk = limits.jerk;
  }

  std::optional<std::vector<LinePhase>> plan() const {
    double low = std::max(begin_, end_);
    double high = std::max(up_.max_speed, low);
    if (high > up_.max_speed * (1.0 + kRoundingOfLine)) return std::nullopt;
    double low_left = left(low);
    if (low_left < -kRoundingOfLine * length_) return std::nullopt;
    double high_left = left(high);
    if (high_left >= 0.0) return phases(high, high_left);
    for (int i = 0; i < kMostSearchSteps && high - low > 1e-14 * high; ++i) {
      // The false position, and every third time the middle.
      double middle = low + (high - low) * low_left / (low_left - high_left);
      if (i % 3 == 2 || !(middle > low && middle < high)) middle = (low + high) / 2.0;
      const double middle_left = left(middle);
      (middle_left >= 0.0 ? low : high) = middle;
      (middle_left >= 0.0 ? low_left : high_left) = middle_left;
      if (middle_left >= 0.0 && middle_left < 1e-13 * length_) break;
    }
    return phases(low, std::max(0.0, low_left));
  }

 private:
  static double wayOf(double from, double peak, const MotionLimits& limits) {
    EndState<double> state(from, 0.0);
    changeVelocity(state, peak, limits);
    return state.length();
  }
  // [unit] What is left of the line for the peak; below 0: it is too short.
  double left(double peak) const {
    return length_ - wayOf(begin_, peak, up_) - wayOf(end_, peak, down_);
  }

  std::vector<LinePhase> phases(double peak, double rest) const {
    std::vector<LinePhase> made;
    Phases up(begin_, 0.0);
    changeVelocity(up, DoubleDouble(peak), up_);
    for (std::size_t i = 0; i < up.size(); ++i) made.push_back({up[i].duration.value(), up[i].j});
    if (rest > 0.0) made.push_back({rest / peak, 0.0});
    Phases down(end_, 0.0);
    changeVelocity(down, DoubleDouble(peak), down_);
    for (std::size_t i = down.size(); i-- > 0;) {
      made.push_back({down[i].duration.value(), down[i].j});
    }
    return made;
  }

  double length_;
  double begin_;
  double end_;
  MotionLimits up_;
  MotionLimits down_;  // backwards
};

}  // namespace

std::optional<std::vector<LinePhase>> planLine(double length, double begin_speed, double end_speed,
                                               const LineLimits& limits) {
  return LinePlanner(length, begin_speed, end_speed, limits).plan();
}

}  // namespace stepdriver::motion
