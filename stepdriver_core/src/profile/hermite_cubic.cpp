#include "hermite_cubic.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {

Piece cubic(DoubleDouble duration, DoubleDouble from, double v0, DoubleDouble to, double v1) {
  const DoubleDouble way = to - from;
  const double time = duration.value();
  const double a = (6.0 * (way.value() / time) - 4.0 * v0 - 2.0 * v1) / time;
  const DoubleDouble rest = way - duration * (duration * (0.5 * a) + v0);
  return {duration, from, v0, a, 6.0 * rest.value() / (time * time * time)};
}

double cubicsFor(double duration, double fourth_derivative, double error) {
  const double pieces = duration * std::pow(fourth_derivative / (384.0 * error), 0.25);
  return std::max(1.0, std::ceil(pieces));
}

}  // namespace stepdriver::motion
