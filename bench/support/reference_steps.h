#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

/// Other methods for the time of the next step of a ramp from rest, to compare the step finder with
/// them in one run. Each gives the times of the steps of a triangle, half of them up and half of
/// them down, with the interface of StepFinder.
namespace stepdriver::bench {

struct Triangle {
  std::int64_t steps = 0;     ///< even
  double acceleration = 0.0;  ///< [steps/s^2] and the deceleration
};

/// The recurrence of Atmel's application note AVR446 (2006), on the ticks of a timer, with the
/// remainder of the division carried: c_n = c_(n-1) - 2 c_(n-1)/(4 n + 1), from
/// c_0 = 0.676 f sqrt(2/a); down the same with n from -N.
class Avr446Integer {
 public:
  Avr446Integer(const Triangle& triangle, double timer_hz)
      : left_(triangle.steps),
        half_(triangle.steps / 2),
        ns_per_tick_(1e9 / timer_hz),
        ticks_(std::llround(0.676 * timer_hz * std::sqrt(2.0 / triangle.acceleration))) {}

  bool next(std::int64_t& time_ns) {
    if (left_ == 0) return false;
    time_ += ticks_;
    time_ns = static_cast<std::int64_t>(static_cast<double>(time_) * ns_per_tick_);
    --left_;
    n_ = n_ + 1 == half_ ? -half_ : n_ + 1;
    const std::int64_t numerator = 2 * ticks_ + rest_;
    const std::int64_t denominator = 4 * n_ + 1;
    ticks_ -= numerator / denominator;
    rest_ = numerator % denominator;
    return true;
  }

 private:
  std::int64_t left_;
  std::int64_t half_;
  double ns_per_tick_;
  std::int64_t ticks_;
  std::int64_t rest_ = 0;
  std::int64_t n_ = 0;
  std::int64_t time_ = 0;  // ticks
};

/// The same in doubles, without a timer.
class Avr446Float {
 public:
  explicit Avr446Float(const Triangle& triangle)
      : left_(triangle.steps),
        half_(static_cast<double>(triangle.steps) / 2.0),
        interval_(0.676e9 * std::sqrt(2.0 / triangle.acceleration)) {}

  bool next(std::int64_t& time_ns) {
    if (left_ == 0) return false;
    time_ += interval_;
    time_ns = static_cast<std::int64_t>(time_);
    --left_;
    n_ = n_ + 1.0 == half_ ? -half_ : n_ + 1.0;
    interval_ -= 2.0 * interval_ / (4.0 * n_ + 1.0);
    return true;
  }

 private:
  std::int64_t left_;
  double half_;
  double interval_;  // ns
  double n_ = 0.0;
  double time_ = 0.0;  // ns
};

/// Torricelli's law for each interval: the speed after i steps is sqrt(2 a i), and its reciprocal
/// is the interval, as in simple sketches.
class PlainSqrt {
 public:
  explicit PlainSqrt(const Triangle& triangle)
      : left_(triangle.steps), steps_(triangle.steps), twice_a_(2.0 * triangle.acceleration) {}

  bool next(std::int64_t& time_ns) {
    if (left_ == 0) return false;
    const std::int64_t i = std::min(steps_ - left_ + 1, left_);
    time_ += 1e9 / std::sqrt(twice_a_ * static_cast<double>(i));
    time_ns = static_cast<std::int64_t>(time_);
    --left_;
    return true;
  }

 private:
  std::int64_t left_;
  std::int64_t steps_;
  double twice_a_;
  double time_ = 0.0;  // ns
};

}  // namespace stepdriver::bench
