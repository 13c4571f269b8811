#pragma once

#include "jerk_limited_knots.h"

namespace stepdriver::motion {

/// The motion of an axis from one knot to the next: the quintic with the states of both as a
/// function of the part u of its duration, from 0 to 1.
class KnotQuintic {
 public:
  /// @param duration [s]
  KnotQuintic(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
              double duration)
      : h_(duration), p0_(begin.position), v0_(begin.velocity), a0_(begin.acceleration) {
    const double way = end.position - begin.position;
    const double v0 = h_ * v0_;
    const double v1 = h_ * end.velocity;
    const double a0 = h_ * h_ * a0_ / 2.0;
    const double a1 = h_ * h_ * end.acceleration / 2.0;
    c3_ = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1;
    c4_ = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1;
    c5_ = 6.0 * way - 3.0 * v0 - 3.0 * v1 - a0 + a1;
  }

  double position(double u) const {
    return p0_ + u * (h_ * v0_ + u * (h_ * h_ * a0_ / 2.0 + u * (c3_ + u * (c4_ + u * c5_))));
  }
  double velocity(double u) const {
    return v0_ + u * (a0_ * h_ + u * (3.0 * c3_ + u * (4.0 * c4_ + u * 5.0 * c5_)) / h_);
  }
  double acceleration(double u) const {
    return a0_ + u * (6.0 * c3_ + u * (12.0 * c4_ + u * 20.0 * c5_)) / (h_ * h_);
  }
  double jerk(double u) const {
    return (6.0 * c3_ + u * (24.0 * c4_ + u * 60.0 * c5_)) / (h_ * h_ * h_);
  }
  /// @name The coefficients of u^3, u^4 and u^5
  /// @{
  double c3() const { return c3_; }
  double c4() const { return c4_; }
  double c5() const { return c5_; }
  /// @}

 private:
  double h_;
  double p0_;
  double v0_;
  double a0_;
  double c3_ = 0.0;
  double c4_ = 0.0;
  double c5_ = 0.0;
};

}  // namespace stepdriver::motion
