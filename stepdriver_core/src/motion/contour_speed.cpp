#include "contour_speed.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

namespace stepdriver::motion {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr double kNegligible = 1e-12;  // of a derivative with respect to the length, which is 1
constexpr int kMostSteps = 100;        // of the search for the largest x

template <typename Bounds>
typename Bounds::value_type lowestAt(const Bounds& bounds, double x) {
  auto found = bounds.front();
  for (const auto& bound : bounds) {
    if (bound.at(x) < found.at(x)) found = bound;
  }
  return found;
}

template <typename Bounds>
typename Bounds::value_type highestAt(const Bounds& bounds, double x) {
  auto found = bounds.front();
  for (const auto& bound : bounds) {
    if (bound.at(x) > found.at(x)) found = bound;
  }
  return found;
}

}  // namespace

ContourSpeed::ContourSpeed(const Contour& contour, const ContourGrid& grid,
                           const std::vector<ContourLimits>& limits, double begin,
                           CheckedAcceleration checked)
    : contour_(contour),
      grid_(grid),
      limits_(limits),
      acceleration_shares_(grid.size(), 1.0),
      speed_shares_(grid.size(), 1.0),
      most_squares_(grid.size(), kUnbounded),
      most_accelerations_(grid.size(), kUnbounded),
      checked_(grid.size(), checked),
      stale_(grid.size(), true),
      controllable_(grid.size() + 1, kUnbounded),
      squares_(grid.size() + 1, kUnbounded) {
  controllable_.back() = 0.0;
  squares_.front() = begin;
}

void ContourSpeed::lower(std::size_t interval, double acceleration, double speed) {
  acceleration_shares_[interval] /= acceleration;
  speed_shares_[interval] /= speed;
  stale_[interval] = true;
}

void ContourSpeed::restrict(std::size_t interval, double square, double acceleration) {
  most_squares_[interval] = square;
  most_accelerations_[interval] = acceleration;
  stale_[interval] = true;
}

bool ContourSpeed::checkBothEnds(std::size_t interval) {
  if (checked_[interval] == CheckedAcceleration::kAtBothEnds) return false;
  checked_[interval] = CheckedAcceleration::kAtBothEnds;
  stale_[interval] = true;
  return true;
}

double ContourSpeed::lossOfBothEnds(std::size_t interval) {
  constexpr double kRounding = 1e-9;
  const double most = controllable_[interval];
  const bool counts = checked_[interval] == CheckedAcceleration::kAtBothEnds && most > 0.0 &&
                      squares_[interval] >= most * (1.0 - kRounding);
  if (!counts) return 1.0;
  checked_[interval] = CheckedAcceleration::kMean;
  const double higher = largestBefore(interval, controllable_[interval + 1]);
  checked_[interval] = CheckedAcceleration::kAtBothEnds;
  return higher / most;
}

void ContourSpeed::regrid(const std::vector<std::size_t>& origins,
                          const std::vector<bool>& divided) {
  const auto spread = [&](auto& values) {
    std::decay_t<decltype(values)> made;
    made.reserve(origins.size() + 1);
    for (const std::size_t origin : origins) made.push_back(values[origin]);
    if (values.size() > divided.size()) made.push_back(values.back());  // of the last place
    values = std::move(made);
  };
  spread(acceleration_shares_);
  spread(speed_shares_);
  spread(most_squares_);
  spread(most_accelerations_);
  spread(checked_);
  spread(controllable_);
  spread(squares_);
  stale_.clear();
  for (const std::size_t origin : origins) stale_.push_back(divided[origin]);
}

void ContourSpeed::plan() {
  const std::size_t size = grid_.size();
  std::vector<bool> changed(size + 1, false);  // at each place, what is controllable
  for (std::size_t i = size; i-- > 0;) {
    giveWayAt(i);
    // The speeds of an interval also limit x at its end.
    const bool due = stale_[i] || changed[i + 1] || (i > 0 && stale_[i - 1]);
    if (!due) continue;
    const double x = grid_.stopsAt(i) ? 0.0 : largestBefore(i, controllable_[i + 1]);
    changed[i] = x != controllable_[i];
    controllable_[i] = x;
  }
  bool moved = false;  // x at the begin of the interval
  for (std::size_t i = 0; i < size; ++i) {
    giveWayAt(i);
    if (!(moved || stale_[i] || changed[i + 1])) continue;
    const double x = largestAfter(i, squares_[i], controllable_[i + 1]);
    moved = x != squares_[i + 1];
    squares_[i + 1] = x;
  }
  stale_.assign(size, false);
}

std::size_t ContourSpeed::settledUntil(std::size_t open) {
  constexpr double kRoundable = 0.5;  // of a segment
  double fast = capAtEnd(grid_.size() - 1);
  double slow = 0.0;
  for (std::size_t i = grid_.size(); i-- > 0;) {
    const ContourGrid::Interval& interval = grid_[i];
    fast = grid_.stopsAt(i) ? 0.0 : i >= open ? kUnbounded : largestBefore(i, fast);
    if (interval.segment + 1 < contour_.size()) {
      slow = grid_.stopsAt(i) ? 0.0 : largestBefore(i, slow);
    } else if (interval.from < kRoundable && interval.straight) {
      const double before = std::min(interval.to, kRoundable) - interval.from;
      const double length = interval.length * before / (interval.to - interval.from);
      slow = std::min(capBefore(i), slow + 2.0 * length * ramp(i).down);
    } else if (interval.to <= kRoundable) {
      slow = largestBefore(i, slow);
    }
    if (fast <= slow) return i;
  }
  return 0;
}

double ContourSpeed::capAt(std::size_t interval, const double* first) const {
  const std::size_t segment = grid_[interval].segment;
  const std::vector<bool>& measured = contour_.measured(segment);
  const double share = speed_shares_[interval];
  double cap = most_squares_[interval];
  double sum = 0.0;
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double square = first[j] * first[j];
    if (measured.empty() || measured[j]) sum += square;
    const double speed = share * limits_[j].speed;
    if (square > 0.0) cap = std::min(cap, speed * speed / square);
  }
  const double speed = contour_.speed(segment);
  return sum > 0.0 ? std::min(cap, speed * speed / sum) : cap;
}

// The speeds on both sides of a place; before an interval.
double ContourSpeed::capBefore(std::size_t place) const {
  const double after = capAt(place, grid_.firstAtBegin(place));
  return place == 0 ? after : std::min(after, capAt(place - 1, grid_.firstAtEnd(place - 1)));
}

ContourSpeed::Ramp ContourSpeed::ramp(std::size_t interval) const {
  const double* first = grid_.firstAtBegin(interval);
  Ramp ramp{kUnbounded, kUnbounded};
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double part = std::abs(first[j]);
    if (!(part > 0.0)) continue;
    ramp.up = std::min(ramp.up, limits_[j].acceleration / part);
    ramp.down = std::min(ramp.down, limits_[j].deceleration / part);
  }
  ramp.up *= acceleration_shares_[interval];
  ramp.down *= acceleration_shares_[interval];
  ramp.up = std::min(ramp.up, most_accelerations_[interval]);
  ramp.down = std::min(ramp.down, most_accelerations_[interval]);
  return ramp;
}

double ContourSpeed::peakSquare(std::size_t interval) const {
  const double begin = squares_[interval];
  const double end = squares_[interval + 1];
  const Ramp along = ramp(interval);
  const double meeting =
      (2.0 * grid_[interval].length * along.up * along.down + begin * along.down + end * along.up) /
      (along.up + along.down);
  return std::max({std::min(meeting, capAtBegin(interval)), begin, end});
}

// What the accelerations of the axes in an interval allow, with x and u at its begin: at its end x
// is x + 2 length u = e^2. With b^2 = x, the mean of an acceleration is
// (q1' e - q0' b) (b + e)/(2 length), and b e is (b^2 + e^2)/2 but for (e - b)^2/2.
void ContourSpeed::collectBounds(std::size_t interval) {
  above_.clear();
  below_.clear();
  most_x_ = kUnbounded;
  const double twice = 2.0 * grid_[interval].length;
  const double* first_begin = grid_.firstAtBegin(interval);
  const double* first_end = grid_.firstAtEnd(interval);
  const double* second_begin = grid_.secondAtBegin(interval);
  const double* second_end = grid_.secondAtEnd(interval);
  const double share = acceleration_shares_[interval];
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const int direction = directionOf(first_begin[j], first_end[j]);
    const double most = share * accelerationTowards(limits_[j], direction, 1);
    const double least = -share * accelerationTowards(limits_[j], direction, -1);
    if (checked_[interval] == CheckedAcceleration::kMean) {
      const double change = first_end[j] - first_begin[j];
      addBounds(first_end[j] + change / 2.0, 2.0 * change / twice, least, most);
    } else {
      addBounds(first_begin[j], second_begin[j], least, most);
      addBounds(first_end[j] + twice * second_end[j], second_end[j], least, most);
    }
  }
  const double along = most_accelerations_[interval];
  if (along == kUnbounded) return;
  above_.push_back({along, 0.0});
  below_.push_back({-along, 0.0});
}

// least <= u_factor u + x_factor x <= most
void ContourSpeed::addBounds(double u_factor, double x_factor, double least, double most) {
  if (std::abs(u_factor) < kNegligible) {
    if (x_factor > 0.0) most_x_ = std::min(most_x_, most / x_factor);
    if (x_factor < 0.0) most_x_ = std::min(most_x_, least / x_factor);
    return;
  }
  const double slope = -x_factor / u_factor;
  above_.push_back({(u_factor > 0.0 ? most : least) / u_factor, slope});
  below_.push_back({(u_factor > 0.0 ? least : most) / u_factor, slope});
}

// x at the end of the interval is from 0 to `end`.
void ContourSpeed::capEnd(std::size_t interval, double end) {
  const double twice = 2.0 * grid_[interval].length;
  above_.push_back({end / twice, -1.0 / twice});
  below_.push_back({0.0, -1.0 / twice});
}

// The largest x at the begin of an interval from which x at its end can be `end` or less. The
// feasible (x, u) are convex and contain (0, 0): from an x that is too large, the two tightest
// bounds of u meet at an x that is smaller, but not smaller than the solution.
double ContourSpeed::largestBefore(std::size_t interval, double end) {
  if (grid_[interval].straight) {
    return std::min(capBefore(interval), end + 2.0 * grid_[interval].length * ramp(interval).down);
  }
  collectBounds(interval);
  capEnd(interval, end);
  double x = std::min(capBefore(interval), most_x_);
  if (x == kUnbounded) x = end + 2.0 * grid_[interval].length * ramp(interval).down;
  for (int i = 0; i < kMostSteps; ++i) {
    const Bound above = lowestAt(above_, x);
    const Bound below = highestAt(below_, x);
    if (above.at(x) >= below.at(x)) break;
    const double meet = (above.offset - below.offset) / (below.slope - above.slope);
    if (!(meet < x)) break;  // rounding
    x = std::max(meet, 0.0);
  }
  return x;
}

double ContourSpeed::largestAfter(std::size_t interval, double begin, double end) {
  const double twice = 2.0 * grid_[interval].length;
  if (grid_[interval].straight) return std::min(end, begin + twice * ramp(interval).up);
  collectBounds(interval);
  capEnd(interval, end);
  return std::clamp(begin + twice * lowestAt(above_, begin).at(begin), 0.0, end);
}

}  // namespace stepdriver::motion
