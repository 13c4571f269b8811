#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "point_to_point/motion_limits.h"
#include "profile/profile.h"
#include "profile/step_finder.h"

namespace stepdriver::motion {

/// Checks a profile, from its pieces alone, against its first state and the limits that it was
/// planned for.
class ProfileCheck {
 public:
  ProfileCheck(const Profile& profile, const MotionState& from, const MotionLimits& limits)
      : profile_(profile), from_(from), limits_(limits) {
    start_ = limits.start_speed;
    may_rest_ = start_ > 0.0 && std::abs(from.velocity) <= start_;
    const double a = may_rest_ ? 0.0 : from.acceleration;
    level_ = from.velocity;
    if (limits.jerk > 0.0) level_ += a * std::abs(a) / (2.0 * limits.jerk);
    fastest_ = std::max({limits.max_speed, std::abs(from.velocity), std::abs(level_)});
    first_a_ = limits.jerk > 0.0 ? std::abs(a) : 0.0;
  }

  /// No jumps except allowed ones, nothing beyond the limits, no sliver.
  void expectWithinLimits() {
    MotionState end{from_.position, from_.velocity, may_rest_ ? 0.0 : from_.acceleration};
    double time = 0.0;
    way_ = 0.0;
    for (const Piece& piece : profile_.pieces()) {
      ASSERT_GT(piece.duration.hi, 1e-15) << "a sliver";
      const MotionState begin{piece.p0, piece.v0, piece.a};
      expectContinuous(end, begin);
      expectPieceWithinLimits(piece, time);
      end = endOf(piece);
      way_ += std::abs((end.position - begin.position).hi);
      time += piece.duration.hi;
    }
    end_ = end;
  }

  /// After expectWithinLimits().
  void expectRestOn(std::int64_t target) const {
    const double off = (profile_.endPosition() - fromInteger(target)).hi;
    EXPECT_LE(std::abs(off), exactPositionDoubt()) << "ends beside the target";
    EXPECT_LE(std::abs(end_.velocity), start_ + speedDoubt());
    if (limits_.jerk > 0.0) {
      EXPECT_LE(std::abs(end_.acceleration), accelerationDoubt());
    }
  }

  /// It makes no step beyond the target, or overshoots it by the stated distance. Call after
  /// expectWithinLimits().
  void expectOvershoot(std::int64_t target, double overshoot) const {
    const double way = (fromInteger(target) - from_.position).hi;
    double farthest = 0.0;
    for (const Piece& piece : profile_.pieces()) {
      const double turn = piece.firstTurn(0.0);
      for (int i = 0; i <= 8; ++i) {
        for (const double t : {turn * i / 8.0, turn + (piece.duration.hi - turn) * i / 8.0}) {
          const double beyond = (piece.positionAt(t) - fromInteger(target)).hi;
          farthest =
              std::max(farthest, way == 0.0 ? std::abs(beyond) : (way > 0.0 ? beyond : -beyond));
        }
      }
    }
    // Less than half a microstep makes no step.
    EXPECT_NEAR(farthest, overshoot, overshoot > 0.0 ? 2.0 * positionDoubt() : 0.495);
  }

  /// It makes no step beyond the target, as seen from its beginning.
  void expectNoStepBeyond(std::int64_t target) const {
    const bool upwards = from_.position < fromInteger(target);
    StepFinder finder(profile_, split(from_.position).whole);
    Step step;
    while (finder.next(step)) {
      const std::int64_t beyond = upwards ? finder.count() - target : target - finder.count();
      ASSERT_LE(beyond, 0) << "at " << step.time_ns << " ns";
    }
  }

  /// The steps lead from one count to the other, and none is closer than the peak speed allows.
  void expectSteps(std::int64_t target) const {
    const std::int64_t begin = split(from_.position).whole;
    StepFinder finder(profile_, begin);
    const auto shortest = static_cast<std::int64_t>(1e9 / std::max(profile_.peakSpeed(), 1e-9));
    Step step;
    Step last;
    while (finder.next(step)) {
      ASSERT_GE(step.time_ns, last.direction == 0 ? profile_.startNs() : last.time_ns);
      if (step.direction == last.direction) {
        // Each end is rounded to a nanosecond.
        ASSERT_GE(step.time_ns - last.time_ns, shortest - 2);
      }
      last = step;
    }
    EXPECT_EQ(finder.count(), target);
  }

  /// The total distance in both directions [microsteps]. Call after expectWithinLimits().
  double way() const { return way_; }

  /// A stop is never faster than the initial speed, or than the speed that the axis reaches within
  /// a microstep.
  double fastestStop() const {
    const double a = limits_.acceleration;
    const double d = limits_.deceleration;
    return std::max({std::abs(from_.velocity), std::abs(level_), std::sqrt(2.0 * a * d / (a + d)),
                     std::min(start_, limits_.max_speed)});
  }

  /// The error of the position from rounding a state to doubles, if it moves. It is largest just
  /// above the start speed: an additional speed of dv takes the time sqrt(dv/j).
  double positionDoubt() const {
    if (from_.velocity == 0.0 && from_.acceleration == 0.0) return exactPositionDoubt();
    const double way = 1e-9 + 1e-14 * (way_ + stopping());
    if (start_ == 0.0 || limits_.jerk == 0.0) return way;
    return way + std::min(1e-3, start_ * std::sqrt(1e-14 * start_ / limits_.jerk));
  }

 private:
  double stopping() const {
    const double v = std::max(std::abs(from_.velocity), std::abs(level_));
    const double braking = v * v / limits_.deceleration;
    return limits_.jerk > 0.0 ? braking + v * limits_.deceleration / limits_.jerk : braking;
  }
  // 1e-15 s is the shortest piece that exists.
  double exactPositionDoubt() const { return 1e-12 + 1e-28 * way_ + 2e-15 * fastest_; }
  double speedDoubt() const { return 1e-14 * fastest_ + 1e-15 * std::max(top(), first_a_); }
  double accelerationDoubt() const {
    return 1e-13 * std::max(top(), first_a_) + 4e-15 * limits_.jerk;
  }
  double top() const { return std::max(limits_.acceleration, limits_.deceleration); }

  static MotionState endOf(const Piece& piece) {
    return {piece.positionAt(piece.duration), piece.velocityAt(piece.duration).value(),
            piece.accelerationAt(piece.duration).value()};
  }

  void expectContinuous(const MotionState& end, const MotionState& begin) const {
    EXPECT_LE(std::abs((end.position - begin.position).hi), positionDoubt()) << "a jump";
    // Up to the start speed the axis may stop and start again; any acceleration ends then.
    const double slow = start_ + speedDoubt();
    const bool at_start_speed = std::abs(end.velocity) <= slow && std::abs(begin.velocity) <= slow;
    if (start_ > 0.0 && at_start_speed) return;
    EXPECT_NEAR(begin.velocity, end.velocity, speedDoubt()) << "a jump of speed";
    if (limits_.jerk > 0.0) {
      EXPECT_NEAR(begin.acceleration, end.acceleration, accelerationDoubt()) << "a jump";
    }
  }

  void expectPieceWithinLimits(const Piece& piece, double time) const {
    EXPECT_LE(std::abs(piece.j), limits_.jerk * (1.0 + 1e-15));
    const double turn = piece.firstTurn(0.0);
    const double end = piece.duration.hi;
    for (const double at : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      expectWithinLimits(piece, end * at, time);
      expectWithinLimits(piece, turn * at, time);
      expectWithinLimits(piece, turn + (end - turn) * at, time);
    }
  }

  void expectWithinLimits(const Piece& piece, double t, double time) const {
    const double v = piece.velocityAt(t).value();
    const double a = piece.accelerationAt(t).value();
    EXPECT_LE(std::abs(v), fastest_ * (1.0 + 1e-14)) << "at " << time + t << " s";
    const bool speeds_up = v * a > 0.0 && std::abs(v) > speedDoubt();
    const double limit = speeds_up ? limits_.acceleration
                                   : (std::abs(v) > speedDoubt() ? limits_.deceleration : top());
    const double brought_back = first_a_ - limits_.jerk * (time + t);
    EXPECT_LE(std::abs(a), std::max(limit, brought_back) + accelerationDoubt())
        << "at " << time + t << " s, v " << v;
    const bool rises = speeds_up && std::abs(a) > accelerationDoubt();
    if (std::abs(v) > limits_.max_speed + speedDoubt() && rises) {
      EXPECT_LT(piece.j * a, 0.0) << "speeds up above the limit, at " << time + t << " s";
    }
  }

  const Profile& profile_;
  MotionState from_;
  MotionLimits limits_;
  double start_ = 0.0;
  bool may_rest_ = false;
  double level_ = 0.0;
  double fastest_ = 0.0;
  double first_a_ = 0.0;
  double way_ = 0.0;
  MotionState end_;
};

}  // namespace stepdriver::motion
