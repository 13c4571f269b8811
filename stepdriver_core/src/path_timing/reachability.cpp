#include "reachability.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
// Compared with 1, the derivative of the position along a path with respect to the length.
constexpr double kNegligible = 1e-12;
constexpr int kMostSteps = 100;  // the steps of the search for the largest x

}  // namespace

Reachability::Reachability(const Path& path, const PathGrid& grid,
                           const std::vector<TimingLimits>& limits, double begin,
                           CheckedAcceleration checked)
    : path_(path), grid_(grid), limits_(limits) {
  // Reserves room for as many intervals as the grid can have.
  const auto fill = [&](auto& values, std::size_t more, auto value) {
    values.reserve(grid.capacity() + more);
    values.assign(grid.size() + more, value);
  };
  fill(acceleration_shares_, 0, 1.0);
  fill(speed_shares_, 0, 1.0);
  fill(most_squares_, 0, kUnbounded);
  fill(most_accelerations_, 0, kUnbounded);
  fill(checked_, 0, checked);
  fill(stale_, 0, true);
  fill(allowed_, 0, Allowed{});
  fill(controllable_, 1, kUnbounded);
  fill(squares_, 1, kUnbounded);
  bands_.reserve(2 * grid.capacity() * limits.size());
  controllable_.back() = 0.0;
  squares_.front() = begin;
}

void Reachability::lower(std::size_t interval, double acceleration, double speed) {
  acceleration_shares_[interval] /= acceleration;
  speed_shares_[interval] /= speed;
  stale_[interval] = true;
}

void Reachability::restrict(std::size_t interval, double square, double acceleration) {
  most_squares_[interval] = square;
  most_accelerations_[interval] = acceleration;
  stale_[interval] = true;
}

bool Reachability::checkBothEnds(std::size_t interval) {
  if (checked_[interval] == CheckedAcceleration::kAtBothEnds) return false;
  checked_[interval] = CheckedAcceleration::kAtBothEnds;
  stale_[interval] = true;
  return true;
}

double Reachability::lossOfBothEnds(std::size_t interval) {
  constexpr double kRounding = 1e-9;
  const double most = controllable_[interval];
  const bool counts = checked_[interval] == CheckedAcceleration::kAtBothEnds && most > 0.0 &&
                      squares_[interval] >= most * (1.0 - kRounding);
  if (!counts) return 1.0;
  Allowed& allowed = allowed_[interval];
  const Allowed checked = allowed;
  const std::size_t bands = bands_.size();
  checked_[interval] = CheckedAcceleration::kMean;
  allowed.most_bands = 0;
  collectBands(interval, allowed);
  const double higher = largestBefore(interval, controllable_[interval + 1]);
  checked_[interval] = CheckedAcceleration::kAtBothEnds;
  allowed = checked;
  bands_.resize(bands);
  return higher / most;
}

void Reachability::regrid(const Division& division) {
  division.spread(acceleration_shares_);
  division.spread(speed_shares_);
  division.spread(most_squares_);
  division.spread(most_accelerations_);
  division.spread(checked_);
  division.spread(allowed_);
  division.spread(controllable_);
  division.spread(squares_);
  division.spread(stale_);
  for (std::size_t i = 0; i < division.intervals.size(); ++i) {
    for (std::size_t k = 0; k < division.parts; ++k) {
      stale_[division.firstPartOf(i) + k] = true;
      allowed_[division.firstPartOf(i) + k].most_bands = 0;
    }
  }
}

void Reachability::plan() {
  const std::size_t size = grid_.size();
  if (stale_.back()) findAllowed(size - 1);
  bool changed = false;  // whether the controllable x at the end of the interval has changed
  for (std::size_t i = size; i-- > 0;) {
    giveWayAt(i);
    const bool stale = stale_[i] != 0;
    const bool stale_before = i > 0 && stale_[i - 1] != 0;
    if (stale_before) findAllowed(i - 1);
    // The speeds of an interval also limit x at its end.
    if (!stale && !changed && !stale_before) continue;
    stale_[i] = stale || changed;  // the second pass plans it again
    const double x = grid_.stopsAt(i) ? 0.0 : largestBefore(i, controllable_[i + 1]);
    changed = x != controllable_[i];
    controllable_[i] = x;
  }
  bool moved = false;  // whether x at the begin of the interval has changed
  for (std::size_t i = 0; i < size; ++i) {
    giveWayAt(i);
    if (!moved && stale_[i] == 0) continue;
    const double x = largestAfter(i, squares_[i], controllable_[i + 1]);
    moved = x != squares_[i + 1];
    squares_[i + 1] = x;
  }
  stale_.assign(size, false);
}

std::size_t Reachability::settledUntil(std::size_t open) {
  constexpr double kRoundable = 0.5;  // the parameter up to which a rounding may begin
  double fast = capAtEnd(grid_.size() - 1);
  double slow = 0.0;
  for (std::size_t i = grid_.size(); i-- > 0;) {
    const PathGrid::Interval& interval = grid_[i];
    fast = grid_.stopsAt(i) ? 0.0 : i >= open ? kUnbounded : largestBefore(i, fast);
    if (interval.segment + 1 < path_.size()) {
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

double Reachability::capAt(std::size_t interval, const double* first) const {
  const std::size_t segment = grid_[interval].segment;
  const std::vector<bool>& measured = path_.measured(segment);
  const double share = speed_shares_[interval];
  double cap = most_squares_[interval];
  double sum = 0.0;
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double square = first[j] * first[j];
    if (measured.empty() || measured[j]) sum += square;
    const double speed = share * limits_[j].speed;
    if (square > 0.0) cap = std::min(cap, speed * speed / square);
  }
  const double speed = share * path_.speed(segment);
  return sum > 0.0 ? std::min(cap, speed * speed / sum) : cap;
}

// The largest x that the speeds on both sides of a place allow, which is before an interval.
double Reachability::capBefore(std::size_t place) const {
  const double after = allowed_[place].cap_at_begin;
  return place == 0 ? after : std::min(after, allowed_[place - 1].cap_at_end);
}

void Reachability::findAllowed(std::size_t interval) {
  Allowed& allowed = allowed_[interval];
  allowed.cap_at_begin = capAt(interval, grid_.firstAtBegin(interval));
  allowed.cap_at_end = capAt(interval, grid_.firstAtEnd(interval));
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

double Reachability::peakSquare(std::size_t interval) const {
  const double begin = squares_[interval];
  const double end = squares_[interval + 1];
  const Ramp& along = ramp(interval);
  const double meeting =
      (2.0 * grid_[interval].length * along.up * along.down + begin * along.down + end * along.up) /
      (along.up + along.down);
  return std::max({std::min(meeting, allowed_[interval].cap_at_begin), begin, end});
}

// Collects what the accelerations of the axes in an interval allow. At its begin, the motion has x
// and u; at its end, x is x + 2 length u = e^2. With b^2 = x, the mean of an acceleration is (q1' e
// - q0' b) (b + e)/(2 length), and b e is (b^2 + e^2)/2 except for (e - b)^2/2.
void Reachability::collectBands(std::size_t interval, Allowed& allowed) {
  allowed.most_x = kUnbounded;
  const bool mean = checked_[interval] == CheckedAcceleration::kMean;
  const double along = most_accelerations_[interval];
  const std::size_t needed = (mean ? 1 : 2) * limits_.size() + (along < kUnbounded ? 1 : 0);
  if (needed > allowed.most_bands) {
    allowed.first_band = bands_.size();
    allowed.most_bands = needed;
    bands_.resize(bands_.size() + needed);
  }
  Band* next = &bands_[allowed.first_band];
  // Adds the band least <= u_factor u + x_factor x <= most.
  const auto add = [&](double u_factor, double x_factor, double least, double most) {
    if (std::abs(u_factor) < kNegligible) {
      if (x_factor > 0.0) allowed.most_x = std::min(allowed.most_x, most / x_factor);
      if (x_factor < 0.0) allowed.most_x = std::min(allowed.most_x, least / x_factor);
      return;
    }
    if (u_factor < 0.0) std::swap(least, most);
    *next++ = {least / u_factor, most / u_factor, -x_factor / u_factor};
  };
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
    if (mean) {
      const double change = first_end[j] - first_begin[j];
      add(first_end[j] + change / 2.0, 2.0 * change / twice, least, most);
    } else {
      add(first_begin[j], second_begin[j], least, most);
      add(first_end[j] + twice * second_end[j], second_end[j], least, most);
    }
  }
  if (along < kUnbounded) add(1.0, 0.0, -along, along);
  allowed.bands = static_cast<std::size_t>(next - &bands_[allowed.first_band]);
}

// The tightest bounds of u at an x, if x at the end of the interval is to be from 0 to `end`.
Reachability::Range Reachability::tightestAt(std::size_t interval, double end, double x) const {
  const double twice = 2.0 * grid_[interval].length;
  Bound low{0.0, -1.0 / twice};
  Bound high{end / twice, -1.0 / twice};
  double least = low.at(x);
  double most = high.at(x);
  const Allowed& allowed = allowed_[interval];
  const Band* const first = bands_.data() + allowed.first_band;
  const Band* const last = first + allowed.bands;
  const Band* lowest = nullptr;
  const Band* highest = nullptr;
  for (const Band* band = first; band != last; ++band) {
    const double shift = band->slope * x;
    if (band->least + shift > least) {
      least = band->least + shift;
      lowest = band;
    }
    if (band->most + shift < most) {
      most = band->most + shift;
      highest = band;
    }
  }
  if (lowest != nullptr) low = {lowest->least, lowest->slope};
  if (highest != nullptr) high = {highest->most, highest->slope};
  return {low, high};
}

// The largest x at the begin of an interval from which x at its end can be `end` or less. The
// feasible (x, u) are convex and contain (0, 0): from an x that is too large, the two tightest
// bounds of u meet at an x that is smaller, but not smaller than the solution.
double Reachability::largestBefore(std::size_t interval, double end) const {
  if (grid_[interval].straight) {
    return std::min(capBefore(interval), end + 2.0 * grid_[interval].length * ramp(interval).down);
  }
  double x = std::min(capBefore(interval), allowed_[interval].most_x);
  for (int i = 0; i < kMostSteps; ++i) {
    const auto [low, high] = tightestAt(interval, end, x);
    if (high.at(x) >= low.at(x)) break;
    const double meet = (high.offset - low.offset) / (low.slope - high.slope);
    if (!(meet < x)) break;  // only rounding is left
    x = std::max(meet, 0.0);
  }
  return x;
}

double Reachability::largestAfter(std::size_t interval, double begin, double end) const {
  const double twice = 2.0 * grid_[interval].length;
  if (grid_[interval].straight) return std::min(end, begin + twice * ramp(interval).up);
  double most = end / twice + (-1.0 / twice) * begin;  // the largest u
  const Allowed& allowed = allowed_[interval];
  for (std::size_t k = 0; k < allowed.bands; ++k) {
    const Band& band = bands_[allowed.first_band + k];
    most = std::min(most, band.most + band.slope * begin);
  }
  return std::clamp(begin + twice * most, 0.0, end);
}

}  // namespace stepdriver::motion
