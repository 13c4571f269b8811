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
/// The velocities at the quarters of the duration are looked at. The highest speed is that of the
/// parabola through the square of the highest of them and its neighbours. A cubic's velocity is a
/// parabola itself, and a quintic's one, from rest to rest, is highest in the middle.
class PathSpeed {
 public:
  static constexpr std::size_t kPlaces = 5;

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
  /// @param velocity returns the velocity of an axis after a part of the duration [unit/s].
  template <typename Velocity>
  void include(std::size_t axis, const Velocity& velocity) {
    if (!measured_->empty() && !(*measured_)[axis]) return;
    for (std::size_t k = 0; k < kPlaces; ++k) {
      const double v = velocity(static_cast<double>(k) / (kPlaces - 1));
      squares_[k] += v * v;
    }
  }
  /// The highest speed, in parts of what is allowed.
  double usage() const {
    const auto top = std::max_element(squares_.begin(), squares_.end());
    const auto middle = std::clamp(top, squares_.begin() + 1, squares_.end() - 2);
    const double slope = (middle[1] - middle[-1]) / 2.0;
    const double bend = middle[1] - 2.0 * middle[0] + middle[-1];
    double highest = *top;
    if (bend < 0.0 && std::abs(slope) < -bend) {
      highest = std::max(highest, middle[0] - slope * slope / (2.0 * bend));
    }
    return std::sqrt(highest) / limit_;
  }

 private:
  double limit_;  // [unit/s]
  const std::vector<bool>* measured_;
  std::array<double, kPlaces> squares_{};  // of the speed [unit^2/s^2]
};

}  // namespace stepdriver::motion
