#pragma once

#include <utility>
#include <vector>

#include "geometry/path.h"

namespace stepdriver::test {

/// @param tolerance [unit] of the corner at its end
inline motion::CurveSegment lineTo(std::vector<double> end, double tolerance) {
  motion::CurveSegment segment;
  segment.end = std::move(end);
  segment.tolerance = tolerance;
  return segment;
}

}  // namespace stepdriver::test
