#include "geometry/path_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "support/path_line.h"

// The intervals into which a path is divided.

namespace stepdriver {
namespace {

using motion::Path;
using motion::PathGrid;
using test::lineTo;

// What is appended to a path may begin where the rounding of a corner ends, except for the last
// bit. No speed could be planned on an interval without a length.
TEST(PathGrid, HasNoIntervalWithoutALengthIfItBeginsAtTheEndOfARounding) {
  const Path path(
      {0.0, 0.0},
      {lineTo({100.0, 0.0}, 2.0), lineTo({100.0, 100.0}, 2.0), lineTo({0.0, 100.0}, 0.0)}, 1.0);
  const Path rest = path.part(1, 2);
  const double end = rest.roundedUntil(0);
  ASSERT_GT(end, 0.0);
  for (const double begin : {std::nextafter(end, 0.0), end, std::nextafter(end, 1.0)}) {
    const PathGrid grid(rest, begin);
    double length = 0.0;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      EXPECT_GT(grid[i].length, 1e-6) << "interval " << i << " from " << begin;
      length += grid[i].length;
    }
    const PathGrid whole(rest, 0.9 * end);
    double longer = 0.0;
    for (std::size_t i = 0; i < whole.size(); ++i) longer += whole[i].length;
    EXPECT_LT(length, longer);
    EXPECT_GT(length, 0.98 * longer);
  }
}

}  // namespace
}  // namespace stepdriver
