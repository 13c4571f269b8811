#include "arc_length.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stepdriver::motion {
namespace {

// Simpson's rule is exact on lines and arcs, where the rate is constant. On a Bezier its error
// falls with the fourth power of this number, and is far below a microstep.
constexpr std::size_t kParts = 256;
// What rounding may add to the length of a segment.
constexpr double kLengthRounding = 1e-9;

double begin(std::size_t part) { return static_cast<double>(part) / kParts; }

}  // namespace

ArcLength::ArcLength(const Path& path, std::size_t segment, std::vector<bool> measured)
    : path_(path), segment_(segment), measured_(std::move(measured)) {
  double length = 0.0;
  for (std::size_t part = 0; part < kParts; ++part) {
    length += between(begin(part), begin(part + 1));
    lengths_.push_back(length);
  }
}

std::optional<double> ArcLength::parameterAt(double distance) const {
  if (distance > length() * (1.0 + kLengthRounding)) return {};
  const auto found = std::lower_bound(lengths_.begin(), lengths_.end(), distance);
  if (found == lengths_.end()) return 1.0;
  const auto part = static_cast<std::size_t>(found - lengths_.begin());
  const double before = part == 0 ? 0.0 : lengths_[part - 1];
  double low = begin(part);
  double high = begin(part + 1);
  // Until they are neighbours.
  for (int i = 0; i < 60; ++i) {
    const double middle = low + (high - low) / 2.0;
    (before + between(begin(part), middle) < distance ? low : high) = middle;
  }
  return high;
}

double ArcLength::rateAt(double parameter) const {
  PathPoint point;
  path_.evaluateGiven(segment_, parameter, point);
  double square = 0.0;
  for (std::size_t axis = 0; axis < point.first.size(); ++axis) {
    if (measured_.empty() || measured_[axis]) square += point.first[axis] * point.first[axis];
  }
  return std::sqrt(square);
}

double ArcLength::between(double from, double to) const {
  const double middle = from + (to - from) / 2.0;
  return (to - from) / 6.0 * (rateAt(from) + 4.0 * rateAt(middle) + rateAt(to));
}

}  // namespace stepdriver::motion
