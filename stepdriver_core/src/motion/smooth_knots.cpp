#include "smooth_knots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kSmallChange = 0.05;  // of the jerk, in parts of its limit: no knot

// When a part of a smoothed motion has moved by a distance [s], before it ends.
double timeUntilMoved(const SmoothPart& part, double distance, double duration) {
  double low = 0.0;
  double high = duration;
  double h = duration / 2.0;
  constexpr int kMostSteps = 60;
  for (int i = 0; i < kMostSteps && high - low > 1e-13 * duration; ++i) {
    const double moved =
        h * (part.speed + h * (part.acceleration / 2.0 + h * part.jerk / 6.0)) - distance;
    (moved > 0.0 ? high : low) = h;
    const double speed = part.speed + h * (part.acceleration + h * part.jerk / 2.0);
    const double newton = h - moved / speed;
    if (std::abs(newton - h) <= 1e-14 * duration) break;
    h = newton > low && newton < high ? newton : (low + high) / 2.0;
  }
  return h;
}

class KnotMaker {
 public:
  KnotMaker(const ContourGrid& grid, const std::vector<ContourLimits>& limits,
            const std::vector<SmoothPart>& parts, double time, double closest)
      : grid_(grid),
        limits_(limits),
        parts_(parts),
        time_(time),
        closest_(closest),
        knots_(grid.axes()) {}

  SmoothKnots make() {
    appendPlace(0, parts_.front(), 0.0, 0);
    double jerk = parts_.front().jerk;
    for (std::size_t k = 0; k + 1 < parts_.size(); ++k) {
      giveWayAt(k);
      const SmoothPart& part = parts_[k];
      const bool becomes_even = k > 0 && part.even && !parts_[k - 1].even;
      if (becomes_even || std::abs(part.jerk - jerk) >
                              kSmallChange * highestJerk(grid_, interval_, limits_, time_)) {
        appendBegin(part, k);
        jerk = part.jerk;
      }
      const SmoothPart& next = parts_[k + 1];
      while (interval_ + 1 < grid_.size() && begin_ + grid_[interval_].length < next.distance) {
        const bool straight = grid_[interval_].straight;
        const bool curved = !straight || !grid_[interval_ + 1].straight;
        begin_ += grid_[interval_].length;
        ++interval_;
        if (!curved) continue;
        const double moved = begin_ - part.distance;
        const double h = moved > 0.0 ? timeUntilMoved(part, moved, next.time - part.time) : 0.0;
        // Without a knot there, a long quintic on a straight part would begin on the curve.
        const bool ends_curve = straight != grid_[interval_].straight;
        if (ends_curve && tooClose(part.time + h) && knots_.size() > 1 &&
            !knots_.back().ends_curve) {
          knots_.dropLast();
        }
        appendPlace(interval_, part, h, k, ends_curve);
      }
    }
    if (knots_.size() > 1 && parts_.back().time - knots_.back().time < closest_) {
      knots_.dropLast();
    }
    appendPlace(grid_.size(), parts_.back(), 0.0, parts_.size() - 1);
    return std::move(knots_);
  }

 private:
  bool tooClose(double time) const {
    return knots_.size() > 0 && time - knots_.back().time < closest_;
  }

  void appendBegin(const SmoothPart& part, std::size_t index) {
    if (tooClose(part.time)) return;
    const double parameter = grid_.evaluateAt(interval_, part.distance - begin_, point_);
    knots_.append({part.time, part.distance, part.speed, interval_, index, parameter,
                   part.acceleration, part.even},
                  point_.position.data(), point_.first.data(), point_.second.data());
  }

  void appendPlace(std::size_t place, const SmoothPart& part, double h, std::size_t index,
                   bool ends_curve = false) {
    if (tooClose(part.time + h)) return;
    const std::size_t before = place == 0 ? 0 : place - 1;
    const double* first = place == 0 ? grid_.firstAtBegin(0) : grid_.firstAtEnd(before);
    const double* second = place == 0 ? grid_.secondAtBegin(0) : grid_.secondAtEnd(before);
    const double speed = part.speed + h * (part.acceleration + h * part.jerk / 2.0);
    const double distance =
        part.distance + h * (part.speed + h * (part.acceleration / 2.0 + h * part.jerk / 6.0));
    const bool even = part.even && (h == 0.0 || parts_[index + 1].even);
    knots_.append({part.time + h, distance, speed, before, index,
                   place == 0 ? grid_[0].from : grid_[before].to, part.acceleration + h * part.jerk,
                   even, ends_curve},
                  grid_.position(place), first, second);
  }

  const ContourGrid& grid_;
  const std::vector<ContourLimits>& limits_;
  const std::vector<SmoothPart>& parts_;
  double time_;     // of the average
  double closest_;  // [s] knots
  SmoothKnots knots_;
  ContourPoint point_;
  std::size_t interval_ = 0;  // that contains the motion
  double begin_ = 0.0;        // of it [unit]
};

}  // namespace

double highestJerk(const ContourGrid& grid, std::size_t interval,
                   const std::vector<ContourLimits>& limits, double time) {
  double highest = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < limits.size(); ++j) {
    const double part =
        std::max(std::abs(grid.firstAtBegin(interval)[j]), std::abs(grid.firstAtEnd(interval)[j]));
    const double acceleration = std::max(limits[j].acceleration, limits[j].deceleration);
    const double jerk = std::min(limits[j].jerk, acceleration / time);
    if (part > 0.0) highest = std::min(highest, jerk / part);
  }
  return highest;
}

SmoothKnots makeKnots(const ContourGrid& grid, const std::vector<ContourLimits>& limits,
                      const std::vector<SmoothPart>& parts, double time, double closest) {
  return KnotMaker(grid, limits, parts, time, closest).make();
}

}  // namespace stepdriver::motion
