#pragma once

#include "motion/double_double.h"
#include "no_time.h"

namespace stepdriver::motion {

/// The end of a sequence of phases of constant jerk: how far and how fast. A search needs no more,
/// and takes doubles; exact ends take DoubleDouble.
template <typename Number>
class Reach {
 public:
  using Real = Number;

  Reach(Real v, Real a) : v_(v), a_(a) {}

  /// Continues for `duration` [s] with the jerk `j`. A phase of less than a millionth of a
  /// nanosecond is only rounding and is ignored.
  void run(double j, Real duration) {
    if (!(highOf(duration) > kNoTime)) return;
    const Real half_change = duration * Real(j * 0.5);
    Real slope = v_ + duration * a_ * Real(0.5);
    if (j != 0.0) slope = slope + duration * half_change * third<Real>();
    length_ = length_ + duration * slope;
    v_ = v_ + duration * (a_ + half_change);
    a_ = a_ + half_change + half_change;
  }
  /// Continues from another velocity and acceleration: a jump, or the exact value for a rounded
  /// one.
  void settle(Real v, Real a) {
    v_ = v;
    a_ = a;
  }

  Real v() const { return v_; }
  Real a() const { return a_; }
  Real length() const { return length_; }  ///< [microsteps] signed

 private:
  Real v_;
  Real a_;
  Real length_ = 0.0;
};

}  // namespace stepdriver::motion
