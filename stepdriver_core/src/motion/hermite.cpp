#include "hermite.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {

Piece cubic(DoubleDouble duration, DoubleDouble from, double v0, DoubleDouble to, double v1) {
  const DoubleDouble mean = (to - from) / duration;
  const DoubleDouble twice_v0 = 2.0 * v0;
  const DoubleDouble a =
      DoubleDouble(2.0) * (DoubleDouble(3.0) * mean - twice_v0 - DoubleDouble(v1)) / duration;
  const DoubleDouble rest = mean - DoubleDouble(v0) - duration * DoubleDouble(a.value() / 2.0);
  const DoubleDouble j = DoubleDouble(6.0) * rest / (duration * duration);
  return {duration, from, v0, a.value(), j.value()};
}

double cubicsFor(double duration, double fourth_derivative, double error) {
  const double pieces = duration * std::pow(fourth_derivative / (384.0 * error), 0.25);
  return std::max(1.0, std::ceil(pieces));
}

}  // namespace stepdriver::motion
