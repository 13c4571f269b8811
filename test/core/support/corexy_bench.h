#pragma once

#include <memory>
#include <string>
#include <vector>

#include "support/bench.h"

namespace stepdriver::test {

/// The axes share their motors.
inline void share(std::vector<config::AxisConfig>& axes, const config::Matrix& matrix) {
  auto kinematics = std::make_shared<config::Kinematics>();
  for (const config::AxisConfig& axis : axes) kinematics->axes.push_back(axis.name);
  kinematics->matrix = matrix;
  kinematics->inverse = *config::inverseOf(matrix);
  for (config::AxisConfig& axis : axes) axis.kinematics = kinematics;
}

/// The axes x and y of a CoreXY: motor a, with the pins of x, moves by x + y, and motor b, with
/// those of y, by x - y.
inline std::vector<config::AxisConfig> coreXyAxes() {
  std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y")};
  share(axes, {{1.0, 1.0}, {1.0, -1.0}});
  return axes;
}

}  // namespace stepdriver::test
