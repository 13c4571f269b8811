#pragma once

#include <array>
#include <cstddef>

#include "math/double_double.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// A time of constant jerk, with the velocity and acceleration at its beginning.
struct Phase {
  DoubleDouble duration;      // [s] above 0
  DoubleDouble v;             // [microsteps/s]
  DoubleDouble a;             // [microsteps/s^2]
  double j = 0.0;             // [microsteps/s^3]
  DoubleDouble displacement;  // [microsteps] signed
};

/// A sequence of phases, built from a velocity and an acceleration: a motion whose position and
/// start time are still unknown. Doesn't allocate.
class Phases {
 public:
  using Real = DoubleDouble;

  Phases(DoubleDouble v, DoubleDouble a) : v_(v), a_(a) {}

  /// Appends a phase of jerk `j`. It is merged with the phase before it if the two are one motion.
  /// A phase of less than a millionth of a nanosecond moves nothing and is left out, but not what
  /// it changes: at the highest acceleration, the lowest speed is reached within that time.
  void run(double j, DoubleDouble duration);
  /// Continues from another velocity and acceleration: a jump, or the exact value for a rounded
  /// one.
  void settle(DoubleDouble v, DoubleDouble a);
  /// Keeps only the first `count` phases. @pre there are at least that many.
  void cut(std::size_t count);

  /// [microsteps] signed
  DoubleDouble length() const {
    DoubleDouble length;
    for (std::size_t i = 0; i < size_; ++i) length = length + phases_[i].displacement;
    return length;
  }
  DoubleDouble v() const { return v_; }
  DoubleDouble a() const { return a_; }
  std::size_t size() const { return size_; }
  const Phase& operator[](std::size_t index) const { return phases_[index]; }

  /// A change of velocity has at most 7 phases: one brings the acceleration to 0, and three lie on
  /// either side of standstill. A motion is two of these and a cruise.
  static constexpr std::size_t kMost = 16;

 private:
  std::array<Phase, kMost> phases_;
  std::size_t size_ = 0;
  DoubleDouble v_;
  DoubleDouble a_;
  DoubleDouble end_v_;  // the velocity at the end of the last phase, from its polynomial
  DoubleDouble end_a_;
};

/// The rounding error in a difference that should be 0, relative to the operands.
template <typename Real>
inline constexpr double kExact = 1e-13;
template <>
inline constexpr double kExact<DoubleDouble> = 1e-29;

Piece pieceOf(const Phase& phase, DoubleDouble position);

}  // namespace stepdriver::motion
