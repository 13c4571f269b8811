#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "geometry/path.h"

namespace stepdriver::motion {

/// How much a motion between two knots uses of the speed along its path. Between the knots, the
/// axes move on polynomials that leave the path by little but may run ahead on it: the motion is
/// faster then than at both ends.
///
/// The square of the speed of quintics is a polynomial of degree 8. Its Bernstein coefficients at
/// the ends are its values there, and it is nowhere above the largest of them: the range is halved
/// where that may matter.
class PathSpeed {
 public:
  /// @param first, last the segments on the way. The fastest of them counts: what the motion leaves
  /// out of a change between two of them lasts no longer than the shortest time between knots.
  PathSpeed(const Path& path, std::size_t first, std::size_t last)
      : limit_(path.speed(first)), measured_(&path.measured(first)) {
    for (std::size_t i = first + 1; i <= last; ++i) {
      if (path.speed(i) <= limit_) continue;
      limit_ = path.speed(i);
      measured_ = &path.measured(i);
    }
  }

  bool isLimited() const { return std::isfinite(limit_); }
  /// @param velocity returns the velocity of an axis after a part of the duration [unit/s]; a
  /// polynomial of degree 4 at most.
  template <typename Velocity>
  void include(std::size_t axis, const Velocity& velocity) {
    if (!measured_->empty() && !(*measured_)[axis]) return;
    const std::array<double, kVelocities> of =
        bernsteinOf({velocity(0.0), velocity(0.25), velocity(0.5), velocity(0.75), velocity(1.0)});
    for (std::size_t i = 0; i < kVelocities; ++i) {
      for (std::size_t k = 0; k < kVelocities; ++k) {
        squares_[i + k] += kBinomials4[i] * kBinomials4[k] / kBinomials8[i + k] * of[i] * of[k];
      }
    }
  }
  /// The highest speed, in parts of what is allowed, if it is more than that; otherwise at most 1.
  double usage() const { return std::sqrt(highest(squares_, 0.0, kMostHalvings)) / limit_; }

 private:
  static constexpr std::size_t kVelocities = 5;
  static constexpr std::size_t kSquares = 9;
  static constexpr std::array<double, kVelocities> kBinomials4{1.0, 4.0, 6.0, 4.0, 1.0};
  static constexpr std::array<double, kSquares> kBinomials8{1.0,  8.0,  28.0, 56.0, 70.0,
                                                            56.0, 28.0, 8.0,  1.0};
  static constexpr double kNoDifference = 1e-6;
  static constexpr int kMostHalvings = 40;  // the excess of the coefficients is quartered by each

  // The coefficients of the polynomial of degree 4 with these values at the quarters.
  static std::array<double, kVelocities> bernsteinOf(const std::array<double, kVelocities>& at) {
    const double first = at[0];
    const double last = at[4];
    const double quarter = 256.0 * at[1] - 81.0 * first - last;  // 108 b1 + 54 b2 + 12 b3
    const double half = 16.0 * at[2] - first - last;             // 4 b1 + 6 b2 + 4 b3
    const double other = 256.0 * at[3] - first - 81.0 * last;    // 12 b1 + 54 b2 + 108 b3
    const double middle = (30.0 * half - quarter - other) / 72.0;
    const double sum = (half - 6.0 * middle) / 4.0;
    const double difference = (quarter - other) / 96.0;
    return {first, (sum + difference) / 2.0, middle, (sum - difference) / 2.0, last};
  }

  // The highest value, if it is above the limit and above one that was found already.
  double highest(std::array<double, kSquares> left, double found, int halvings) const {
    found = std::max({found, left.front(), left.back()});
    const double most = *std::max_element(left.begin(), left.end());
    const bool matters = most > std::max(found, limit_ * limit_) * (1.0 + kNoDifference);
    if (!matters || halvings == 0) return found;
    std::array<double, kSquares> right{};
    for (std::size_t end = kSquares; end-- > 0;) {
      right[end] = left.back();
      for (std::size_t i = kSquares - 1; i + end >= kSquares; --i) {
        left[i] = (left[i - 1] + left[i]) / 2.0;
      }
    }
    return highest(right, highest(left, found, halvings - 1), halvings - 1);
  }

  double limit_;  // [unit/s]
  const std::vector<bool>* measured_;
  std::array<double, kSquares> squares_{};  // the coefficients [unit^2/s^2]
};

}  // namespace stepdriver::motion
