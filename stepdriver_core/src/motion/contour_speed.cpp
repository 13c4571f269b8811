#include "contour_speed.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr double kNegligible = 1e-12;  // of a derivative with respect to the length, which is 1
constexpr int kMostSteps = 100;        // of the search for the largest x

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
      allowed_(grid.size()),
      controllable_(grid.size() + 1, kUnbounded),
      squares_(grid.size() + 1, kUnbounded) {
  bands_.reserve(2 * grid.size() * limits.size());
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
  const Allowed checked = allowed_[interval];
  const std::size_t bands = bands_.size();
  checked_[interval] = CheckedAcceleration::kMean;
  findAllowed(interval);
  const double higher = largestBefore(interval, controllable_[interval + 1]);
  checked_[interval] = CheckedAcceleration::kAtBothEnds;
  allowed_[interval] = checked;
  bands_.resize(bands);
  return higher / most;
}

void ContourSpeed::regrid(const std::vector<std::size_t>& origins,
                          const std::vector<bool>& divided) {
  const auto grow = [&](auto& values) {
    const bool of_places = values.size() > divided.size();
    const auto last = values.back();
    values.resize(origins.size());
    // No origin is after its interval: from the end on, nothing is replaced before it is copied.
    for (std::size_t i = origins.size(); i-- > 0;) values[i] = values[origins[i]];
    if (of_places) values.push_back(last);
  };
  grow(acceleration_shares_);
  grow(speed_shares_);
  grow(most_squares_);
  grow(most_accelerations_);
  grow(checked_);
  grow(allowed_);
  grow(controllable_);
  grow(squares_);
  stale_.clear();
  for (const std::size_t origin : origins) stale_.push_back(divided[origin]);
}

void ContourSpeed::plan() {
  const std::size_t size = grid_.size();
  if (stale_.back()) findAllowed(size - 1);
  bool changed = false;  // what is controllable at the end of the interval
  for (std::size_t i = size; i-- > 0;) {
    giveWayAt(i);
    const bool stale = stale_[i];
    const bool stale_before = i > 0 && stale_[i - 1];
    if (stale_before) findAllowed(i - 1);
    // The speeds of an interval also limit x at its end.
    if (!stale && !changed && !stale_before) continue;
    stale_[i] = stale || changed;  // for the second pass
    const double x = grid_.stopsAt(i) ? 0.0 : largestBefore(i, controllable_[i + 1]);
    changed = x != controllable_[i];
    controllable_[i] = x;
  }
  bool moved = false;  // x at the begin of the interval
  for (std::size_t i = 0; i < size; ++i) {
    giveWayAt(i);
    if (!moved && !stale_[i]) continue;
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
  const double after = allowed_[place].cap_at_begin;
  return place == 0 ? after : std::min(after, allowed_[place - 1].cap_at_end);
}

void ContourSpeed::findAllowed(std::size_t interval) {
  Allowed& allowed = allowed_[interval];
  allowed.cap_at_begin = capAtBegin(interval);
  allowed.cap_at_end = capAtEnd(interval);
  if (!grid_[interval].straight) {
    collectBands(interval, allowed);
    return;
  }
  allowed.ramp = {kUnbounded, kUnbounded};
  const double share = acceleration_shares_[interval];
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double part = std::abs(grid_.firstAtBegin(interval)[j]);
    if (!(part > 0.0)) continue;
    allowed.ramp.up = std::min(allowed.ramp.up, share * limits_[j].acceleration / part);
    allowed.ramp.down = std::min(allowed.ramp.down, share * limits_[j].deceleration / part);
  }
  allowed.ramp.up = std::min(allowed.ramp.up, most_accelerations_[interval]);
  allowed.ramp.down = std::min(allowed.ramp.down, most_accelerations_[interval]);
}

double ContourSpeed::peakSquare(std::size_t interval) const {
  const double begin = squares_[interval];
  const double end = squares_[interval + 1];
  const Ramp& along = ramp(interval);
  const double meeting =
      (2.0 * grid_[interval].length * along.up * along.down + begin * along.down + end * along.up) /
      (along.up + along.down);
  return std::max({std::min(meeting, allowed_[interval].cap_at_begin), begin, end});
}

// What the accelerations of the axes in an interval allow, with x and u at its begin: at its end x
// is x + 2 length u = e^2. With b^2 = x, the mean of an acceleration is
// (q1' e - q0' b) (b + e)/(2 length), and b e is (b^2 + e^2)/2 but for (e - b)^2/2.
void ContourSpeed::collectBands(std::size_t interval, Allowed& allowed) {
  allowed.most_x = kUnbounded;
  allowed.first_band = bands_.size();
  allowed.bands = 0;
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
      addBand(allowed, first_end[j] + change / 2.0, 2.0 * change / twice, least, most);
    } else {
      addBand(allowed, first_begin[j], second_begin[j], least, most);
      addBand(allowed, first_end[j] + twice * second_end[j], second_end[j], least, most);
    }
  }
  const double along = most_accelerations_[interval];
  if (along < kUnbounded) addBand(allowed, 1.0, 0.0, -along, along);
}

// least <= u_factor u + x_factor x <= most
void ContourSpeed::addBand(Allowed& allowed, double u_factor, double x_factor, double least,
                           double most) {
  if (std::abs(u_factor) < kNegligible) {
    if (x_factor > 0.0) allowed.most_x = std::min(allowed.most_x, most / x_factor);
    if (x_factor < 0.0) allowed.most_x = std::min(allowed.most_x, least / x_factor);
    return;
  }
  const auto [low, high] = std::minmax({least / u_factor, most / u_factor});
  bands_.push_back({low, high, -x_factor / u_factor});
  ++allowed.bands;
}

// The lowest and the highest u at an x, if x at the end of the interval is from 0 to `end`.
std::pair<ContourSpeed::Bound, ContourSpeed::Bound> ContourSpeed::tightestAt(std::size_t interval,
                                                                             double end,
                                                                             double x) const {
  const double twice = 2.0 * grid_[interval].length;
  Bound low{0.0, -1.0 / twice};
  Bound high{end / twice, -1.0 / twice};
  double least = low.at(x);
  double most = high.at(x);
  const Allowed& allowed = allowed_[interval];
  for (std::size_t k = 0; k < allowed.bands; ++k) {
    const Band& band = bands_[allowed.first_band + k];
    const double shift = band.slope * x;
    if (band.least + shift > least) {
      least = band.least + shift;
      low = {band.least, band.slope};
    }
    if (band.most + shift < most) {
      most = band.most + shift;
      high = {band.most, band.slope};
    }
  }
  return {low, high};
}

// The largest x at the begin of an interval from which x at its end can be `end` or less. The
// feasible (x, u) are convex and contain (0, 0): from an x that is too large, the two tightest
// bounds of u meet at an x that is smaller, but not smaller than the solution.
double ContourSpeed::largestBefore(std::size_t interval, double end) const {
  if (grid_[interval].straight) {
    return std::min(capBefore(interval), end + 2.0 * grid_[interval].length * ramp(interval).down);
  }
  double x = std::min(capBefore(interval), allowed_[interval].most_x);
  for (int i = 0; i < kMostSteps; ++i) {
    const auto [low, high] = tightestAt(interval, end, x);
    if (high.at(x) >= low.at(x)) break;
    const double meet = (high.offset - low.offset) / (low.slope - high.slope);
    if (!(meet < x)) break;  // rounding
    x = std::max(meet, 0.0);
  }
  return x;
}

double ContourSpeed::largestAfter(std::size_t interval, double begin, double end) const {
  const double twice = 2.0 * grid_[interval].length;
  if (grid_[interval].straight) return std::min(end, begin + twice * ramp(interval).up);
  const Bound high = tightestAt(interval, end, begin).second;
  return std::clamp(begin + twice * high.at(begin), 0.0, end);
}

}  // namespace stepdriver::motion
