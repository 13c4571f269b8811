#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "spline.h"

namespace stepdriver::motion {

/// One end of a segment.
struct SplineKnot {
  std::int64_t time_ns = 0;
  DoubleDouble position;
  std::optional<double> velocity;
  std::optional<double> acceleration;
};

/// A quintic over u from 0 to 1: p0 + c1 u + ... + c5 u^5 [microsteps].
struct Quintic {
  DoubleDouble p0, c1, c2, c3, c4, c5;

  DoubleDouble positionAt(DoubleDouble u) const;
  DoubleDouble slopeAt(DoubleDouble u) const;
  double thirdDerivativeAt(double u) const;
  /// The largest absolute value over the whole quintic.
  double largestFourthDerivative() const;
  double reach() const;
};

/// The kind of curve of a segment, see planSpline().
enum class SegmentKind { kLine, kCubic, kQuintic };

struct SplineSegment {
  SplineKnot begin;
  SplineKnot end;
  std::size_t index = 0;  ///< the index of the waypoint at its end

  SegmentKind kind() const;
  DoubleDouble duration() const;  ///< [s]
  /// @pre kind() is kQuintic
  Quintic quintic() const;
};

/// The segments of a trajectory, each made on demand. The first one begins at the start of the
/// motion, each other one at a waypoint.
class SplineSegments {
 public:
  /// @param waypoints outlive this. @pre requirePlannable()
  explicit SplineSegments(const std::vector<Waypoint>& waypoints);

  std::size_t size() const { return waypoints_.size() - skipped_; }
  SplineSegment first(const MotionState& from) const;
  /// @pre index > 0
  SplineSegment at(std::size_t index) const;
  /// Makes the next segment from this one.
  void advance(SplineSegment& segment) const;

 private:
  SplineKnot knot(std::size_t waypoint) const;

  const std::vector<Waypoint>& waypoints_;
  // The number of waypoints at time 0, which have passed when the motion starts.
  std::size_t skipped_;
};

}  // namespace stepdriver::motion
