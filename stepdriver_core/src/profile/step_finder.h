#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "profile.h"
#include "profile_sum.h"

namespace stepdriver::motion {

/// A microstep that is due at one time.
struct Step {
  std::int64_t time_ns = 0;  ///< motion time
  int direction = 0;         ///< +1 or -1
};

/// Finds the steps of a profile, one after the other, on demand.
///
/// The count goes from k - 1 to k when the curve crosses k - 1/2 upwards, and back when it crosses
/// it downwards; a curve that only touches the line makes no step. Each step's time comes from the
/// curve itself, never from the step before: errors do not accumulate. Times are exact to the
/// nanosecond to which they are rounded.
///
/// The curve is followed in stretches in which the speed only rises or only falls, each from its
/// slow end. If the speed is the same at both ends, it is a line, whatever residual of a sum its
/// acceleration is. Without a jerk all terms of the equation have the same sign there, and the root
/// in the form 2 x / (v + sqrt(v^2 + 2 a x)) has no cancellation. The form (sqrt(v^2 + 2 a x) -
/// v)/a, which needs no division, has an error of about 2^-52 V/a, with V the speed at the fast
/// end: it is used if the motor takes less than hours from rest to V. With a jerk the finder uses
/// Newton's method, starting at the time that the cubic through the last four steps' times
/// predicts. That is mostly so near that one iteration is enough; the second term of its error, a
/// dt^2/(2 v), shows this without another evaluation. Otherwise more iterations follow, from the
/// last step's time and inside a bracket.
///
/// Doesn't allocate or throw. Only one thread may use it at a time.
class StepFinder {
 public:
  StepFinder() = default;

  /// @param profile outlives the finder.
  /// @param count the position of the axis: within one step of the profile's beginning.
  StepFinder(const Profile& profile, std::int64_t count);
  /// Finds the steps of a motor that several axes share. @param sum outlives the finder, which
  /// calls its next().
  StepFinder(ProfileSum& sum, std::int64_t count);

  /// @return false if no step is left; `step` is then unchanged.
  bool next(Step& step);
  /// Goes on to the step with which the count becomes one of these two, whichever comes first. The
  /// steps before it are left out: a stretch takes the same time however many it has.
  /// @pre low < count() < high, each of them less than 2^61 from 0
  bool nextTo(std::int64_t low, std::int64_t high, Step& step);

  /// The position of the axis after the steps that were returned or left out.
  std::int64_t count() const { return stretch_.anchor_count + stretch_.away * stretch_.way; }

 private:
  // A part of a piece in which the speed only rises or only falls, seen from its slow end
  // ("anchor"): the distance from there is v t + a t^2/2 + j t^3/6, with t counted away from the
  // anchor.
  struct Stretch {
    // Formulas for short stretches are used for all except the longest ones.
    enum class Curve { kShortLine, kShortParabola, kLine, kParabola, kCubic };
    Curve curve = Curve::kLine;
    int direction = 0;       // the direction of the motion
    double time_sign = 1.0;  // +1: the anchor is the beginning, -1: it is the end
    Split anchor_ns;         // motion time
    std::int64_t anchor_count = 0;
    std::int64_t away = 1;  // direction of the count away from the anchor: +1 or -1
    // Steps from the anchor. A step without a jerk changes nothing else: with several finders in
    // turn, each step waits for what the one before it stored.
    std::int64_t way = 0;
    std::int64_t way_step = 0;
    std::int64_t way_end = 0;
    double way_rest = 0.0;  // the next line lies way + way_rest from the anchor
    double v = 0.0;
    double a = 0.0;
    double j = 0.0;
    double v_squared = 0.0;
    double twice_a = 0.0;
    double ns_per_s = 1e9;     // with time_sign
    double ns_per_unit = 0.0;  // ns_per_s / v for a kShortLine, ns_per_s / a for a kShortParabola
    double duration = 0.0;     // s
    DoubleDouble exact_v;      // v and a with all their bits
    DoubleDouble exact_a;
    // [s] The times of the last steps from the anchor, the latest first.
    std::array<double, 4> last = {};
    int known = 0;  // how many of these times are known
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
  };

  bool enterNext();
  bool enterNextOfSum();
  void enter(const Piece& piece, DoubleDouble begin, DoubleDouble end, DoubleDouble piece_start);
  void chooseCurve(bool constant_speed, double fastest);
  bool give(Step& step, std::int64_t time_ns);
  // These functions are rare or long: if they were inlined, next() would need a stack frame.
  [[gnu::noinline]] bool nextOfNewStretch(Step& step);
  [[gnu::noinline]] bool nextOfOther(Step& step, double way);
  double timeFromAnchor(double way);
  double cubicTime(double way);
  double bracketedTime(double way) const;
  std::int64_t refined(double rough) const;

  const Profile* profile_ = nullptr;
  ProfileSum* sum_ = nullptr;  // null if the steps are those of a profile
  std::int64_t start_ns_ = 0;  // motion time at which the profile or the sum begins
  std::size_t piece_ = 0;
  double done_ = 0.0;  // [s] the part of the piece that earlier stretches have covered
  Stretch stretch_;
};

}  // namespace stepdriver::motion
