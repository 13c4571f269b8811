#pragma once

#include "motion/profile.h"

namespace stepdriver::motion {

/// The cubic that has these positions and velocities at its ends. The jerk is taken last, and makes
/// up for what rounding took from the acceleration: the piece ends where the next one begins.
Piece cubic(DoubleDouble duration, DoubleDouble from, double v0, DoubleDouble to, double v1);

/// How many such cubics keep within `error` of a curve of this fourth derivative:
/// (duration/n)^4/384 fourth <= error.
double cubicsFor(double duration, double fourth_derivative, double error);

}  // namespace stepdriver::motion
