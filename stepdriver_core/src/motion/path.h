#pragma once

#include <array>
#include <cstddef>

#include "motion/double_double.h"
#include "motion/profile.h"

namespace stepdriver::motion {

/// A time of constant jerk, with the velocity and acceleration that it begins with.
struct Phase {
  DoubleDouble duration;  // s, above 0
  DoubleDouble v;         // microsteps/s
  DoubleDouble a;         // microsteps/s^2
  double j = 0.0;         // microsteps/s^3
};

/// Phases in a row, built one after the other from a velocity and an acceleration: a motion before
/// it knows where it lies and when it begins. Doesn't allocate.
class Path {
 public:
  Path(DoubleDouble v, DoubleDouble a) : v_(v), a_(a) {}

  /// A phase of jerk `j` from where the path has come to. It joins the phase before it where the
  /// two are one motion; one of no duration is none: less than a millionth of a nanosecond is only
  /// rounding.
  void run(double j, DoubleDouble duration);
  /// Goes on from another velocity and acceleration: a jump, or the exact value for a rounded one.
  void settle(DoubleDouble v, DoubleDouble a);
  /// Runs as `other` does from where it began up to phase `count`.
  void append(const Path& other, std::size_t count);

  DoubleDouble v() const { return v_; }
  DoubleDouble a() const { return a_; }
  DoubleDouble length() const { return length_; }  ///< [microsteps] signed
  std::size_t size() const { return size_; }
  const Phase& operator[](std::size_t index) const { return phases_[index]; }

 private:
  // A change of velocity has at most 7 phases: one brings the acceleration to 0, and three lie on
  // either side of standstill. A motion is two of these and a cruise.
  static constexpr std::size_t kMost = 16;

  std::array<Phase, kMost> phases_;
  std::size_t size_ = 0;
  DoubleDouble v_;
  DoubleDouble a_;
  DoubleDouble end_v_;  // of the last phase, as it comes out of its polynomial
  DoubleDouble end_a_;
  DoubleDouble length_;
};

/// What double-double arithmetic leaves of a difference that is none, relative to the operands.
constexpr double kExact = 1e-29;

/// The way of a phase in the time `t` from its beginning.
DoubleDouble wayOf(const Phase& phase, DoubleDouble t);

Piece pieceOf(const Phase& phase, DoubleDouble position);

}  // namespace stepdriver::motion
