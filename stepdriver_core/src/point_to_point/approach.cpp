#include "approach.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "end_state.h"
#include "math/root_finding.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoise = 4e-15;  // the relative noise of a search in doubles
constexpr double kSure = 1e-8;    // relative; below this the sign of a rough value means nothing
constexpr double kLimitRounding = 1e-12;  // the relative rounding of an acceleration limit

DoubleDouble stoppingLength(DoubleDouble v, DoubleDouble a, const MotionLimits& limits) {
  EndState<DoubleDouble> stop(v, a);
  comeToRest(stop, limits);
  return stop.length();
}

// The fastest stop under a jerk limit, in doubles and as a formula.
struct RoughStop {
  double length = 0.0;  // [microsteps] signed
  // [microsteps/s] How much farther it ends for each second that the motion continues first.
  double farther = 0.0;
  bool applies = true;  // false: the stop has another form
};

// All values are seen in the direction of the stop. It is the stop from the speed w = v + a^2/(2 J)
// without acceleration that begins a/J earlier, or later if the motion already slows down. From w
// it takes the distance w/2 (w/d + d/J), or w sqrt(w/J) if the deceleration doesn't reach d. With a
// start speed, the ramp ends at that speed.
RoughStop roughStop(double v, double a, double j, const MotionLimits& limits) {
  const double start = limits.start_speed;
  const double level = v + a * std::abs(a) / (2.0 * limits.jerk);
  const double sign = (start > 0.0 ? v : level) < 0.0 ? -1.0 : 1.0;
  v *= sign;
  a *= sign;
  if (v <= start && start > 0.0) return {0.0, sign * v};
  const double d = limits.deceleration;
  const double t = a / limits.jerk;
  const double w = v + 0.5 * a * t;
  const double change = w - start;
  const bool reaches = change * limits.jerk > d * d;
  const double ramp =
      reaches ? change / d + d / limits.jerk : 2.0 * std::sqrt(change / limits.jerk);
  const double slope = reaches ? 1.0 / d : 0.5 * ramp / change;
  const double mean = 0.5 * (w + start);
  RoughStop stop;
  stop.length = sign * (mean * ramp + t * (w - a * t / 6.0));
  stop.farther = sign * (1.0 + sign * j / limits.jerk) * (v + a * (0.5 * ramp + mean * slope + t));
  stop.applies = a >= -d * (1.0 + kLimitRounding) && sign * level >= start;
  return stop;
}

// The moment at which a motion leaves the change to the maximum speed to stop.
struct Switch {
  std::size_t phase = 0;
  DoubleDouble time;  // [s] from the beginning of the phase
};

std::optional<Switch> switchWithJerk(const Phases& phases, DoubleDouble length,
                                     double missing_before, double sign,
                                     const MotionLimits& limits) {
  DoubleDouble left = length;  // the distance that is left at the beginning of a phase
  for (std::size_t i = 0; i < phases.size(); ++i) {
    const Phase& phase = phases[i];
    // The distance that is missing if the motion leaves the phase at a time and stops as fast as
    // possible. It falls with the time.
    const auto rough = [&](double t) {
      const Advance<double> end = advance(phase.v.hi, phase.a.hi, phase.j, t);
      const RoughStop stop = roughStop(end.v, end.a, phase.j, limits);
      return Value{sign * (left.hi - end.displacement - stop.length), -sign * stop.farther};
    };
    const auto exact = [&](DoubleDouble t) {
      const Advance<DoubleDouble> end = advance(phase.v, phase.a, phase.j, t);
      return (left - end.displacement - stoppingLength(end.v, end.a, limits)) * sign;
    };
    const bool last = i + 1 == phases.size();
    const DoubleDouble v = last ? phases.v() : phases[i + 1].v;
    const DoubleDouble a = last ? phases.a() : phases[i + 1].a;
    const RoughStop stop = roughStop(v.hi, a.hi, phase.j, limits);
    const DoubleDouble left_after = left - phase.displacement;
    const double scale = std::max(std::abs(left.hi), std::abs(phase.displacement.hi));
    double missing = sign * (left_after.hi - stop.length);
    if (!stop.applies || !(std::abs(missing) > kSure * scale)) {
      missing = sign * (left_after - stoppingLength(v, a, limits)).hi;
    }
    if (missing <= 0.0) {
      const Bracket bracket{0.0, phase.duration.hi, missing_before, missing};
      return Switch{i, rootNear(exact, newtonRootOf(rough, bracket, kNoise * scale), bracket.high)};
    }
    left = left_after;
    missing_before = missing;
  }
  return std::nullopt;
}

// Without a jerk limit the stop moves on only while the speed rises, which is the end of the
// phases: by w^2/(2 a) + w^2/(2 d) until the speed is w, if it begins at standstill or passes it. A
// rise that takes no time is no phase; the phases then end with a phase that slows down, whose
// acceleration has the same sign.
std::optional<Switch> switchWithoutJerk(const Phases& phases, DoubleDouble missing, double sign,
                                        const MotionLimits& limits) {
  if (phases.size() == 0) return std::nullopt;
  const std::size_t last = phases.size() - 1;
  const Phase& phase = phases[last];
  const double a = limits.acceleration;
  if (sign * phase.a.hi != a) return std::nullopt;
  const DoubleDouble ratio = exactSum(a, limits.deceleration) / limits.deceleration;
  const DoubleDouble u = phase.v * sign;
  const DoubleDouble square = u.hi > 0.0 ? u * u : DoubleDouble();
  const DoubleDouble time = (sqrt(square + missing * (2.0 * a) / ratio) - u) / a;
  if (!(time < phase.duration)) return std::nullopt;
  return Switch{last, time};
}

void finish(Approach& motion, const MotionLimits& limits) {
  motion.first_part = motion.phases.size();
  comeToRest(motion.phases, limits);
}

}  // namespace

Stop::Stop(DoubleDouble v, DoubleDouble a, const MotionLimits& limits)
    : length_(stoppingLength(v, a, limits)), v_(v), a_(a), limits_(limits) {}

bool Stop::meets(double distance) const {
  const double off = std::abs(distance);
  if (off <= kLeastDoubt) return true;
  if (off > kMostDoubt) return false;
  const DoubleDouble rounded(1.0 + 1e-15);
  const auto change = [this](DoubleDouble v, DoubleDouble a) {
    return std::abs((stoppingLength(v, a, limits_) - length_).hi);
  };
  return off <= kLeastDoubt + change(v_ * rounded, a_) + change(v_, a_ * rounded);
}

Approach approach(DoubleDouble v, DoubleDouble a, DoubleDouble length, const Stop& stop,
                  const MotionLimits& limits) {
  Approach motion{Phases(v, a)};
  const DoubleDouble beyond = length - stop.length();
  if (stop.meets(beyond.hi)) {
    finish(motion, limits);
    return motion;
  }
  const double sign = beyond.hi > 0.0 ? 1.0 : -1.0;
  Phases& phases = motion.phases;
  changeToMaximum(phases, sign, limits);
  const std::optional<Switch> leave =
      limits.jerk > 0.0 ? switchWithJerk(phases, length, std::abs(beyond.hi), sign, limits)
                        : switchWithoutJerk(phases, abs(beyond), sign, limits);
  if (leave) {
    const double jerk = phases[leave->phase].j;
    phases.cut(leave->phase);
    phases.run(jerk, leave->time);
  } else {
    const DoubleDouble left = length - phases.length();
    const DoubleDouble cruise = left - stoppingLength(phases.v(), phases.a(), limits);
    phases.run(0.0, cruise / phases.v());
  }
  finish(motion, limits);
  return motion;
}

}  // namespace stepdriver::motion
