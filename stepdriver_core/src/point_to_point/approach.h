#pragma once

#include "motion_limits.h"
#include "phases.h"

namespace stepdriver::motion {

/// The fastest way to rest from a velocity and an acceleration.
class Stop {
 public:
  /// @param limits outlive the object.
  Stop(DoubleDouble v, DoubleDouble a, const MotionLimits& limits);

  DoubleDouble length() const { return length_; }  ///< [microsteps] signed

  /// Whether the stop may end at a place this far [microsteps] from where it ends. The length is
  /// uncertain by a thousandth of a microstep at most, because the velocity and the acceleration
  /// are rounded to doubles.
  bool meets(double distance) const;

 private:
  static constexpr double kLeastDoubt = 1e-9;
  static constexpr double kMostDoubt = 1e-3;

  DoubleDouble length_;
  DoubleDouble v_;
  DoubleDouble a_;
  const MotionLimits& limits_;
};

/// A motion to rest, in two parts: the first begins where the motion begins, the second ends where
/// it ends.
struct Approach {
  Phases phases;
  std::size_t first_part = 0;  ///< the number of its phases
};

/// The fastest motion to rest over `length` from a velocity and an acceleration. It begins with the
/// fastest change to the maximum speed, and switches to the fastest stop at the last moment from
/// which that ends at the target. (A time-optimal motion is always at one limit or another, and
/// switches from one such arc to the next once.) The later it switches, the farther it goes, so
/// there is only one such moment. Without a jerk limit it is a closed form; with one, a search in
/// doubles within its phase finds it, and a correction makes it exact.
///
/// With a start speed, the motion is at most that fast, or goes towards the end of `length` and can
/// stop there.
///
/// @param stop from that velocity and acceleration.
Approach approach(DoubleDouble v, DoubleDouble a, DoubleDouble length, const Stop& stop,
                  const MotionLimits& limits);

}  // namespace stepdriver::motion
