#include "approach.h"

#include <algorithm>
#include <cmath>

#include "reach.h"
#include "root.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoise = 1e-15;  // of a search in doubles, relative
constexpr double kSure = 1e-8;    // relative; below this the sign of a rough value means nothing

DoubleDouble stoppingLength(DoubleDouble v, DoubleDouble a, const MotionLimits& limits) {
  Reach<DoubleDouble> stop(v, a);
  comeToRest(stop, limits);
  return stop.length();
}

// How much of a distance is missing if a motion leaves a phase at a time and stops as fast as
// possible, as a function of that time. In the direction of the motion, so that it falls.
template <typename Real>
class Missing {
 public:
  Missing(Real left, Real v, Real a, double j, double sign, const MotionLimits& limits)
      : left_(left), v_(v), a_(a), j_(j), sign_(sign), limits_(limits) {}

  Real operator()(Real t) const {
    Reach<Real> reach(v_, a_);
    reach.run(j_, t);
    comeToRest(reach, limits_);
    return Real(sign_) * (left_ - reach.length());
  }

 private:
  Real left_;
  Real v_;
  Real a_;
  double j_;
  double sign_;
  const MotionLimits& limits_;
};

void finish(Approach& motion, const MotionLimits& limits) {
  motion.first_part = motion.path.size();
  comeToRest(motion.path, limits);
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
  Approach motion{Path(v, a)};
  const DoubleDouble beyond = length - stop.length();
  if (stop.meets(beyond.hi)) {
    finish(motion, limits);
    return motion;
  }
  const double sign = beyond.hi > 0.0 ? 1.0 : -1.0;
  Path& path = motion.path;
  changeToMaximum(path, sign, limits);
  DoubleDouble left = length;  // of the distance, at the beginning of a phase
  double missing_before = std::abs(beyond.hi);
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Phase& phase = path[i];
    const Missing<double> rough(left.hi, phase.v.hi, phase.a.hi, phase.j, sign, limits);
    const Missing<DoubleDouble> exact(left, phase.v, phase.a, phase.j, sign, limits);
    const double duration = phase.duration.hi;
    const DoubleDouble way = wayOf(phase, phase.duration);
    const double scale = std::max(std::abs(left.hi), std::abs(way.hi));
    double missing = rough(duration);
    if (!(std::abs(missing) > kSure * scale)) missing = exact(phase.duration).hi;
    if (missing <= 0.0) {
      const double jerk = phase.j;
      path.cut(i);
      path.run(jerk,
               rootOf(rough, exact, {0.0, duration, missing_before, missing}, kNoise * scale));
      finish(motion, limits);
      return motion;
    }
    left = left - way;
    missing_before = missing;
  }
  const DoubleDouble cruise = left - stoppingLength(path.v(), path.a(), limits);
  path.run(0.0, cruise / path.v());
  finish(motion, limits);
  return motion;
}

}  // namespace stepdriver::motion
