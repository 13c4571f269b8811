#pragma once

#include "math/double_double.h"
#include "profile/negligible_time.h"

namespace stepdriver::motion {

/// A motion from a velocity and an acceleration after a time of constant jerk.
template <typename Real>
struct Advance {
  Real displacement;  ///< [microsteps] signed
  Real v;             ///< [microsteps/s]
  Real a;             ///< [microsteps/s^2]
};

/// @param t [s] @param j [microsteps/s^3]
template <typename Real>
Advance<Real> advance(Real v, Real a, double j, Real t) {
  const Real by_a = t * a;
  if (j == 0.0) return {t * (v + half(by_a)), v + by_a, a};
  const Real a_change = t * j;
  const Real by_j = half(t * a_change);
  return {t * (v + half(by_a) + by_j * third<Real>()), v + (by_a + by_j), a + a_change};
}

/// The end of a sequence of phases of constant jerk: how far and how fast. A search needs no more,
/// and takes doubles; exact ends take DoubleDouble.
template <typename Number>
class EndState {
 public:
  using Real = Number;

  EndState(Real v, Real a) : v_(v), a_(a) {}

  /// Continues for `duration` [s] with the jerk `j`. A phase of less than a millionth of a
  /// nanosecond moves nothing, as in Phases.
  void run(double j, Real duration) {
    if (!(highOf(duration) > 0.0)) return;
    const Advance<Real> end = advance(v_, a_, j, duration);
    if (highOf(duration) > kNegligibleTime) length_ = length_ + end.displacement;
    settle(end.v, end.a);
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
