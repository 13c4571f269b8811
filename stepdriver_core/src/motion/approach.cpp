#include "approach.h"

#include <algorithm>
#include <cmath>

#include "root.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

DoubleDouble stoppingLength(DoubleDouble v, DoubleDouble a, const MotionLimits& limits) {
  Path path(v, a);
  comeToRest(path, limits);
  return path.length();
}

// The distance of a motion that leaves a phase at the time t and stops as fast as possible.
DoubleDouble endAfter(const Phase& phase, DoubleDouble t, const MotionLimits& limits) {
  const DoubleDouble v = phase.v + t * (phase.a + t * DoubleDouble(phase.j * 0.5));
  const DoubleDouble a = phase.a + t * DoubleDouble(phase.j);
  return wayOf(phase, t) + stoppingLength(v, a, limits);
}

Approach finish(Path path, const MotionLimits& limits) {
  const std::size_t first_part = path.size();
  comeToRest(path, limits);
  return {path, first_part};
}

}  // namespace

Stop stopFrom(DoubleDouble v, DoubleDouble a, const MotionLimits& limits) {
  const DoubleDouble rounded(1.0 + 1e-15);
  const DoubleDouble length = stoppingLength(v, a, limits);
  const auto change = [&](DoubleDouble other_v, DoubleDouble other_a) {
    return std::abs((stoppingLength(other_v, other_a, limits) - length).hi);
  };
  return {length, std::min(1e-9 + change(v * rounded, a) + change(v, a * rounded), 1e-3)};
}

Approach approach(DoubleDouble v, DoubleDouble a, DoubleDouble length, const MotionLimits& limits) {
  const Stop stop = stopFrom(v, a, limits);
  const DoubleDouble beyond = length - stop.length;
  if (std::abs(beyond.hi) <= stop.doubt) return finish(Path(v, a), limits);

  const double sign = beyond.hi > 0.0 ? 1.0 : -1.0;
  Path fastest(v, a);
  changeToMaximum(fastest, sign, limits);
  DoubleDouble left = length;  // of the distance, at the beginning of a phase
  for (std::size_t i = 0; i < fastest.size(); ++i) {
    const Phase& phase = fastest[i];
    const auto missing = [&](DoubleDouble t) {
      return DoubleDouble(sign) * (left - endAfter(phase, t, limits));
    };
    if (missing(phase.duration).hi <= 0.0) {
      Path path(v, a);
      path.append(fastest, i);
      path.settle(phase.v, phase.a);
      path.run(phase.j, rootOf(missing, phase.duration.hi));
      return finish(path, limits);
    }
    left = left - wayOf(phase, phase.duration);
  }
  const DoubleDouble cruise = left - stoppingLength(fastest.v(), fastest.a(), limits);
  fastest.run(0.0, cruise / fastest.v());
  return finish(fastest, limits);
}

}  // namespace stepdriver::motion
