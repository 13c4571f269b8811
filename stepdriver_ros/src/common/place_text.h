#pragma once

#include <cmath>
#include <string>

#include "common/text.h"

namespace stepdriver::ros_node {

/// A place without its unit. The rounding of sums doesn't show at 0.
inline std::string placeNumber(double position, double steps_per_unit) {
  return roundedText(std::abs(position) * steps_per_unit < 0.5 ? 0.0 : position);
}

}  // namespace stepdriver::ros_node
