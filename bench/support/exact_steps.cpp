#include "support/exact_steps.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::bench {

long double ExactMotion::Phase::positionAt(long double t) const {
  return position + t * (velocity + t * (acceleration / 2.0L + t * jerk / 6.0L));
}

long double ExactMotion::Phase::velocityAt(long double t) const {
  return velocity + t * (acceleration + t * jerk / 2.0L);
}

void ExactMotion::add(long double duration, long double acceleration, long double jerk) {
  if (duration <= 0.0L) return;
  Phase phase = end_;
  phase.duration = duration;
  phase.acceleration = acceleration;
  phase.jerk = jerk;
  phases_.push_back(phase);
  end_.start = phase.start + duration;
  end_.position = phase.positionAt(duration);
  end_.velocity = phase.velocityAt(duration);
}

long double ExactMotion::crossing(long double line) {
  const long double wanted = line / scale_;
  const auto after = std::find_if(phases_.begin(), phases_.end() - 1, [wanted](const Phase& phase) {
    return phase.positionAt(phase.duration) > wanted;
  });
  const Phase& phase = *after;
  // Only bisection, to the last bit: slow, but beyond doubt.
  long double low = 0.0L;
  long double high = phase.duration;
  while (true) {
    const long double middle = low + (high - low) / 2.0L;
    if (!(middle > low && middle < high)) break;
    (phase.positionAt(middle) < wanted ? low : high) = middle;
  }
  return phase.start + high;
}

ExactMotion ExactMotion::trapezoid(long double way, long double speed, long double acceleration,
                                   long double deceleration) {
  const long double ramps =
      speed * speed / (2.0L * acceleration) + speed * speed / (2.0L * deceleration);
  ExactMotion motion;
  motion.add(speed / acceleration, acceleration, 0.0L);
  motion.add((way - ramps) / speed, 0.0L, 0.0L);
  motion.add(speed / deceleration, -deceleration, 0.0L);
  return motion;
}

ExactMotion ExactMotion::sCurve(long double way, long double speed, long double acceleration,
                                long double jerk) {
  const long double rise = acceleration / jerk;
  const long double hold = speed / acceleration - rise;
  ExactMotion motion;
  motion.add(rise, 0.0L, jerk);
  motion.add(hold, acceleration, 0.0L);
  motion.add(rise, acceleration, -jerk);
  motion.add((way - speed * (2.0L * rise + hold)) / speed, 0.0L, 0.0L);
  motion.add(rise, 0.0L, -jerk);
  motion.add(hold, -acceleration, 0.0L);
  motion.add(rise, -acceleration, jerk);
  return motion;
}

ExactMotion ExactMotion::scaled(long double scale) const {
  ExactMotion motion = *this;
  motion.scale_ = scale;
  return motion;
}

void ErrorMeter::add(std::int64_t time_ns, long double exact_s) {
  const long double error = static_cast<long double>(time_ns) - exact_s * 1e9L;
  worst_ = std::max(worst_, std::abs(error));
  squares_ += error * error;
  ++count_;
}

StepErrors ErrorMeter::errors() const {
  const long double count = std::max<long double>(1.0L, count_);
  return {static_cast<double>(worst_), static_cast<double>(std::sqrt(squares_ / count))};
}

}  // namespace stepdriver::bench
