#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::config {

/// A matrix, by rows.
using Matrix = std::vector<std::vector<double>>;

/// Axes that share motors, as on a CoreXY. There are as many motors as axes; the n-th motor is the
/// one whose driver chip and pins stand in the n-th axis. Endstops, scales and limits in an axis
/// are those of the axis. Such an axis can't have motors of its own, a backlash, an idle timeout or
/// a brake.
///
/// @code{.cpp}
/// config::Kinematics corexy;
/// corexy.axes = {"x", "y"};
/// corexy.matrix = {{1.0, 1.0}, {1.0, -1.0}};
/// corexy.inverse = *config::inverseOf(corexy.matrix);
/// @endcode
struct Kinematics {
  std::vector<std::string> axes;  ///< their names
  /// For each motor: [unit] how far it moves for a unit of each axis. A unit of a motor is as many
  /// steps as one of the axis that has its pins.
  Matrix matrix;
  /// For each axis: [unit] how far it moves for a unit of each motor.
  Matrix inverse;

  /// The place of an axis among them; their number if it isn't one of them.
  std::size_t numberOf(const std::string& axis) const;
};

/// The inverse of a square matrix; empty if it is singular.
std::optional<Matrix> inverseOf(Matrix matrix);

/// How much larger the effect of an error can get, from 1 on: the product of the largest sums of
/// rows of a matrix and its inverse.
double conditionOf(const Matrix& matrix, const Matrix& inverse);

}  // namespace stepdriver::config
