#pragma once

#include <cstddef>
#include <cstdint>

#include "stepdriver_core/motion/profile.h"

namespace stepdriver::motion {

struct Step {
  std::int64_t time_ns = 0;  ///< motion time
  int direction = 0;         ///< +1 or -1
};

/// Finds the steps of a profile, one after the other, each when it is asked for.
///
/// The count goes from k - 1 to k when the curve crosses k - 1/2 upwards, and back when it crosses
/// it downwards; a curve that only touches the line makes no step. Each step's time comes from the
/// curve itself, never from the step before: errors do not add up. Times are right to the
/// nanosecond they are rounded to.
///
/// Between two turning points the curve is followed from its slow end, where all terms of the
/// equation have one sign: 2 x / (v + sqrt(v^2 + 2 a x)) then cancels nothing. With a jerk,
/// Newton's method from the last step's time, kept inside a bracket.
///
/// Doesn't allocate or throw. Not for use from two threads at once.
class StepFinder {
 public:
  StepFinder() = default;

  /// @param profile outlives the finder.
  /// @param count where the axis stands: within one step of the profile's beginning.
  StepFinder(const Profile& profile, std::int64_t count);

  /// @return false where no step is left; `step` is untouched then.
  bool next(Step& step);

  /// Where the axis stands after the steps that next() has given.
  std::int64_t count() const { return count_; }

 private:
  // A part of a piece without a turning point, as seen from its slow end ("anchor"): the way from
  // there is v t + a t^2/2 + j t^3/6 with t away from the anchor.
  struct Stretch {
    double direction = 0.0;  // of the motion
    double time_sign = 1.0;  // +1: the anchor is the beginning, -1: it is the end
    Split anchor_ns;         // after the profile's start
    Split anchor_position;   // microsteps
    double v = 0.0;
    double a = 0.0;
    double j = 0.0;
    double duration = 0.0;  // s
    double last = 0.0;      // s from the anchor: the time of the step before
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    std::int64_t steps_left = 0;
  };

  bool enterNext();
  void enter(const Piece& piece, DoubleDouble begin, DoubleDouble end, DoubleDouble piece_start);
  double timeFromAnchor(double way);
  double solveCubic(double way) const;
  std::int64_t refined(double t, double line) const;

  const Profile* profile_ = nullptr;
  std::size_t piece_ = 0;
  double done_ = 0.0;  // s of the piece that earlier stretches have covered
  std::int64_t count_ = 0;
  Stretch stretch_;
};

}  // namespace stepdriver::motion
