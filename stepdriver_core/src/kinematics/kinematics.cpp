#include "stepdriver_core/kinematics/kinematics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stepdriver::config {
namespace {

double largestRow(const Matrix& matrix) {
  double largest = 0.0;
  for (const std::vector<double>& row : matrix) {
    double sum = 0.0;
    for (const double value : row) sum += std::abs(value);
    if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, sum);
  }
  return largest;
}

}  // namespace

std::size_t Kinematics::numberOf(const std::string& axis) const {
  return static_cast<std::size_t>(std::find(axes.begin(), axes.end(), axis) - axes.begin());
}

// Gauss and Jordan, with the largest pivot of each column.
std::optional<Matrix> inverseOf(Matrix matrix) {
  const std::size_t size = matrix.size();
  Matrix inverse(size, std::vector<double>(size, 0.0));
  for (std::size_t i = 0; i < size; ++i) inverse[i][i] = 1.0;
  for (std::size_t column = 0; column < size; ++column) {
    std::size_t pivot = column;
    for (std::size_t row = column; row < size; ++row) {
      if (std::abs(matrix[row][column]) > std::abs(matrix[pivot][column])) pivot = row;
    }
    if (matrix[pivot][column] == 0.0) return std::nullopt;
    std::swap(matrix[pivot], matrix[column]);
    std::swap(inverse[pivot], inverse[column]);
    const double scale = matrix[column][column];
    for (std::size_t i = 0; i < size; ++i) {
      matrix[column][i] /= scale;
      inverse[column][i] /= scale;
    }
    for (std::size_t row = 0; row < size; ++row) {
      const double factor = matrix[row][column];
      if (row == column || factor == 0.0) continue;
      for (std::size_t i = 0; i < size; ++i) {
        matrix[row][i] -= factor * matrix[column][i];
        inverse[row][i] -= factor * inverse[column][i];
      }
    }
  }
  return inverse;
}

double conditionOf(const Matrix& matrix, const Matrix& inverse) {
  return largestRow(matrix) * largestRow(inverse);
}

}  // namespace stepdriver::config
