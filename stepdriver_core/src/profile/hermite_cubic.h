#pragma once

#include "profile.h"

namespace stepdriver::motion {

/// The cubic that has these positions and velocities at its ends. The jerk is calculated last, and
/// compensates for the rounding of the acceleration: the piece ends exactly at the beginning of the
/// next one.
Piece cubic(DoubleDouble duration, DoubleDouble from, double v0, DoubleDouble to, double v1);

/// How many such cubics stay within `error` of a curve with this fourth derivative:
/// (duration/n)^4/384 fourth <= error.
double cubicsFor(double duration, double fourth_derivative, double error);

}  // namespace stepdriver::motion
