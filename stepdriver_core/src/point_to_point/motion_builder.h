#pragma once

#include <cstdint>
#include <vector>

#include "approach.h"
#include "motion_limits.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// Builds a motion from a state, part by part.
class MotionBuilder {
 public:
  MotionBuilder(const MotionState& from, const MotionLimits& limits);

  /// Comes to rest on `target` as fast as possible.
  void moveTo(std::int64_t target, const MotionLimits& limits);
  /// The same. @param stop a stop from the current velocity and acceleration.
  void moveTo(std::int64_t target, const Stop& stop, const MotionLimits& limits);
  /// Turns at `target`, which it reaches against the direction `sign`, with the acceleration that
  /// this needs. @return false if the turning point lies beyond the target; nothing is added.
  bool turnAt(std::int64_t target, double sign, const MotionLimits& limits);
  /// Changes the velocity to the maximum and keeps it.
  void moveOn(double sign, const MotionLimits& limits);

  /// The sign of the direction from which it comes to rest.
  double heading(const MotionLimits& limits) const;
  /// The first whole microstep on which it can come to rest without turning.
  std::int64_t nextRest(const MotionLimits& limits) const;

  DoubleDouble position() const { return position_; }
  DoubleDouble v() const { return v_; }
  DoubleDouble a() const { return a_; }

  /// All parts of the motion. It is the last call.
  Profile profile(std::int64_t start_ns);

 private:
  // A velocity may differ from that at the end of a change to a limit or to rest by rounding only.
  // Such a velocity is corrected, because otherwise there would be slivers.
  void unround(const MotionLimits& limits);
  void add(const Approach& part, DoubleDouble end);

  DoubleDouble position_;
  DoubleDouble v_;
  DoubleDouble a_;
  std::vector<Piece> pieces_;
};

}  // namespace stepdriver::motion
