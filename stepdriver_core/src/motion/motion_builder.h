#pragma once

#include <cstdint>
#include <vector>

#include "approach.h"
#include "motion/limits.h"
#include "motion/profile.h"

namespace stepdriver::motion {

/// A motion put together from a state on, part by part.
class MotionBuilder {
 public:
  MotionBuilder(const MotionState& from, const MotionLimits& limits);

  /// The fastest way to rest on `target`.
  void moveTo(std::int64_t target, const MotionLimits& limits);
  /// Turns round at `target`, which it comes to against the direction `sign`, with the acceleration
  /// that needs. @return false where the turning point lies beyond the target; nothing is added.
  bool turnAt(std::int64_t target, double sign, const MotionLimits& limits);
  /// Changes the velocity to the maximum and holds it.
  void moveOn(double sign, const MotionLimits& limits);

  /// The sign of the direction from which it comes to rest.
  double heading(const MotionLimits& limits) const;
  /// The first whole microstep that it can rest on without turning round.
  std::int64_t nextRest(const MotionLimits& limits) const;

  DoubleDouble position() const { return position_; }
  DoubleDouble v() const { return v_; }
  DoubleDouble a() const { return a_; }

  Profile profile(std::int64_t start_ns) const;

 private:
  // Takes the velocity that a change to one of the limits, or to rest, has at its acceleration for
  // the one that the rounding to doubles has left beside it: there would be slivers else.
  void unround(const MotionLimits& limits);
  void add(const Approach& part, DoubleDouble end);

  DoubleDouble position_;
  DoubleDouble v_;
  DoubleDouble a_;
  std::vector<Piece> pieces_;
};

}  // namespace stepdriver::motion
