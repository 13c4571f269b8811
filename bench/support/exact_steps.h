#pragma once

#include <cstdint>
#include <vector>

namespace stepdriver::bench {

/// A motion in textbook form, in long doubles, independent of all code of the core: phases of
/// constant jerk, one after another.
class ExactMotion {
 public:
  explicit ExactMotion(long double scale = 1.0L) : scale_(scale) {}

  /// Appends a phase, which begins where the last phase ended.
  void add(long double duration, long double acceleration, long double jerk);
  /// Call before the first add().
  void startAt(long double velocity) { end_.velocity = velocity; }

  /// The time at which the curve crosses `line` going up [s]; the speed is not negative before
  /// that.
  long double crossing(long double line);

  /// From rest to rest with separate ramps; the cruise is long enough to exist, or has length 0.
  static ExactMotion trapezoid(long double way, long double speed, long double acceleration,
                               long double deceleration);
  /// The same with a jerk limit, with equal acceleration and deceleration, and all seven phases.
  static ExactMotion sCurve(long double way, long double speed, long double acceleration,
                            long double jerk);
  /// Scales positions: the share of one axis in a line.
  ExactMotion scaled(long double scale) const;

 private:
  struct Phase {
    long double start = 0.0L;  // s
    long double duration = 0.0L;
    long double position = 0.0L;
    long double velocity = 0.0L;
    long double acceleration = 0.0L;
    long double jerk = 0.0L;

    long double positionAt(long double t) const;
    long double velocityAt(long double t) const;
  };

  std::vector<Phase> phases_;
  Phase end_;  // where the next phase begins
  long double scale_;
};

/// Differences of step times from the exact ones [ns].
struct StepErrors {
  double worst = 0.0;
  double rms = 0.0;
};

/// Adds a difference.
class ErrorMeter {
 public:
  void add(std::int64_t time_ns, long double exact_s);
  StepErrors errors() const;

 private:
  long double worst_ = 0.0L;
  long double squares_ = 0.0L;
  std::int64_t count_ = 0;
};

}  // namespace stepdriver::bench
