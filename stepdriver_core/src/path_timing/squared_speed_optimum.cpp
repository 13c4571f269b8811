#include "squared_speed_optimum.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kBeyondLimit = std::numeric_limits<double>::infinity();
// The part of the duration by which it may be longer than the optimum: a barrier of the weight 1/w
// costs 1/w for each limit that the optimum reaches (S. Boyd and L. Vandenberghe, Convex
// Optimization, 11.2.2), and it is at one limit for each coefficient.
constexpr double kFirstGap = 0.1;
constexpr double kLastGap = 1e-3;
constexpr double kFactorOfGap = 0.1;
constexpr double kRoundedFactor = 0.9;
// What is left to win for one gap is half of Newton's decrement. This part of all gaps is too
// little to go on.
constexpr double kSmallDecrement = 1e-3;
// The step is halved until it wins this part of what its begin promises (Armijo's rule, with the
// usual part).
constexpr double kLeastWon = 0.1;
// From a motion that is 20 % slower than the optimum, it takes 10 steps, and 30 from one that is as
// slow as 1/100 of it.
constexpr int kMostNewtonSteps = 40;
constexpr int kMostHalvings = 40;
constexpr std::size_t kCheap = 8;  // A step takes about an eighth of a place's time for each piece.

}  // namespace

void SquaredSpeedOptimum::append(double length, double cap,
                                 const std::vector<PathDerivatives>& ends) {
  lengths_.push_back(length);
  caps_.push_back(cap);
  ends_.insert(ends_.end(), ends.begin(), ends.end());
}

// The row of a sum of the coefficients before and after a place, around the piece that ends or
// begins there.
SquaredSpeedOptimum::Three SquaredSpeedOptimum::around(bool at_end,
                                                       const std::array<double, 2>& two) {
  return at_end ? Three{0.0, two[0], two[1]} : Three{two[0], two[1], 0.0};
}

void SquaredSpeedOptimum::findPlaces() {
  const std::size_t size = lengths_.size();
  places_.assign(size + 1, {});
  for (std::size_t k = 1; k < size; ++k) {
    const double before = lengths_[k - 1];
    const double after = lengths_[k];
    Place& place = places_[k];
    if (k == 1) {
      // x = k s^(4/3) up to this place, and the next coefficient is half a piece ahead.
      const double part = 1.0 / (1.0 + 2.0 * after / (3.0 * before));
      place = {{0.0, part}, {0.0, 4.0 / 3.0 * part / before}};
    } else if (k + 1 == size) {
      const double part = 1.0 / (1.0 + 2.0 * before / (3.0 * after));
      place = {{part, 0.0}, {-4.0 / 3.0 * part / after, 0.0}};
    } else {
      const double both = before + after;
      place = {{after / both, before / both}, {-2.0 / both, 2.0 / both}};
    }
  }
}

void SquaredSpeedOptimum::findRows() {
  const std::size_t size = lengths_.size();
  const std::size_t axes = limits_.size();
  middles_.assign(size, {});
  // Both ends of each piece have a jerk for each axis; their speed is limited there and within.
  jerks_.reserve(2 * size * axes);
  linears_.reserve(size * (2 + axes));
  for (std::size_t i = 0; i < size; ++i) {
    giveWayAt(i);
    first_jerk_.push_back(jerks_.size());
    first_linear_.push_back(linears_.size());
    const Three begin = around(false, places_[i].square);
    const Three end = around(true, places_[i + 1].square);
    const Three slope_begin = around(false, places_[i].slope);
    const Three slope_end = around(true, places_[i + 1].slope);
    const double length = lengths_[i];
    const bool first = i == 0;
    const bool last = i + 1 == size;
    Three bend{};
    for (std::size_t k = 0; k < 3; ++k) {
      middles_[i][k] = first  ? end[k]
                       : last ? begin[k]
                              : (begin[k] + end[k] + (k == 1 ? 2.0 : 0.0)) / 4.0;
      bend[k] = first  ? 4.0 / 9.0 * end[k] / (length * length)
                : last ? 4.0 / 9.0 * begin[k] / (length * length)
                       : (slope_end[k] - slope_begin[k]) / length;
    }
    if (!first) appendJerk(i, false, bend);
    if (!last) appendJerk(i, true, bend);
    if (!first && !last) linears_.push_back({i, true, {0.0, 1.0, 0.0}, 1.0 / caps_[i], 0.0});
    if (first) continue;
    linears_.push_back({i, true, begin, 1.0 / std::min(caps_[i - 1], caps_[i]), 0.0});
    for (std::size_t j = 0; j < axes; ++j) {
      const PathDerivatives& path = ends_[2 * i * axes + j];
      const double forwards = path.first;
      if (forwards == 0.0 && path.second == 0.0) continue;
      Three row{};
      for (std::size_t k = 0; k < 3; ++k) {
        row[k] = forwards * slope_begin[k] / 2.0 + path.second * begin[k];
      }
      const double up = 1.0 / limits_[j].acceleration;
      const double down = 1.0 / limits_[j].deceleration;
      linears_.push_back({i, false, row, forwards > 0.0 ? up : down, forwards > 0.0 ? down : up});
    }
  }
  first_jerk_.push_back(jerks_.size());
  first_linear_.push_back(linears_.size());
}

void SquaredSpeedOptimum::appendJerk(std::size_t piece, bool at_end, const Three& bend) {
  const Place& place = places_[piece + (at_end ? 1 : 0)];
  const Three square = around(at_end, place.square);
  const Three slope = around(at_end, place.slope);
  double straight = 0.0;  // the largest row of the axes that move on a line
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double by = 1.0 / limits_[j].jerk;
    if (by == 0.0) continue;
    const PathDerivatives& path = ends_[(2 * piece + (at_end ? 1 : 0)) * limits_.size() + j];
    if (path.second == 0.0 && path.third == 0.0) {
      straight = std::max(straight, std::abs(path.first) * by);
      continue;
    }
    Three rate{};
    for (std::size_t k = 0; k < 3; ++k) {
      rate[k] =
          by * (path.third * square[k] + 1.5 * path.second * slope[k] + 0.5 * path.first * bend[k]);
    }
    jerks_.push_back({piece, square, rate});
  }
  if (straight == 0.0) return;
  Three rate{};
  for (std::size_t k = 0; k < 3; ++k) rate[k] = straight * bend[k] / 2.0;
  jerks_.push_back({piece, square, rate});
}

double SquaredSpeedOptimum::timeOf(const std::vector<double>& x) const {
  double time = 0.0;
  for (std::size_t i = 0; i < lengths_.size(); ++i) {
    const bool rests = i == 0 || i + 1 == lengths_.size();
    time += (rests ? 3.0 : 1.0) * lengths_[i] / std::sqrt(at(i, middles_[i], x));
  }
  return time;
}

// The duration times the weight, less the logarithms of what is left of all limits. Infinite beyond
// a limit.
double SquaredSpeedOptimum::sumOf(const std::vector<double>& x, double weight) const {
  for (std::size_t i = 1; i + 1 < lengths_.size(); ++i) {
    if (!(x[i + 1] > 0.0)) return kBeyondLimit;
  }
  double logarithms = 0.0;
  double product = 1.0;
  const auto include = [&](double slack) {
    product *= slack;
    if (product < 1e-100) {
      logarithms += std::log(product);
      product = 1.0;
    }
    return slack > 1e-100;
  };
  for (const Linear& linear : linears_) {
    const double value = at(linear.piece, linear.row, x);
    if (!include(1.0 - value * linear.most) ||
        (linear.least > 0.0 && !include(1.0 + value * linear.least))) {
      return kBeyondLimit;
    }
  }
  for (const Jerk& jerk : jerks_) {
    const double square = at(jerk.piece, jerk.square, x);
    const double rate = at(jerk.piece, jerk.rate, x);
    if (!include(1.0 - square * rate * rate)) return kBeyondLimit;
  }
  return weight * timeOf(x) - logarithms - std::log(product);
}

bool SquaredSpeedOptimum::improve(double weight) {
  for (std::vector<double>& diagonal : matrix_) {
    std::fill(diagonal.begin(), diagonal.end(), 0.0);
  }
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  const auto add = [&](std::size_t piece, const Three& row, double first, double second) {
    for (std::size_t k = 0; k < 3; ++k) {
      gradient_[piece + k] += first * row[k];
      const double by = second * row[k];
      for (std::size_t l = k; l < 3; ++l) matrix_[l - k][piece + k] += by * row[l];
    }
  };
  for (std::size_t i = 0; i < lengths_.size(); ++i) {
    if (i % kCheap == 0) giveWayAt(i / kCheap);
    const bool rests = i == 0 || i + 1 == lengths_.size();
    const double middle = at(i, middles_[i], x_);
    const double time = weight * (rests ? 3.0 : 1.0) * lengths_[i] / std::sqrt(middle);
    add(i, middles_[i], -0.5 * time / middle, 0.75 * time / (middle * middle));
  }
  for (const Linear& linear : linears_) {
    const double value = at(linear.piece, linear.row, x_);
    const double above = linear.most / (1.0 - value * linear.most);
    const double below = linear.least / (1.0 + value * linear.least);
    add(linear.piece, linear.row, above - below, above * above + below * below);
  }
  for (const Jerk& jerk : jerks_) {
    const double square = at(jerk.piece, jerk.square, x_);
    const double rate = at(jerk.piece, jerk.rate, x_);
    const double root = std::sqrt(square);
    const double use = root * rate;
    Three row;
    for (std::size_t k = 0; k < 3; ++k) {
      row[k] = root * jerk.rate[k] + 0.5 * rate / root * jerk.square[k];
    }
    const double above = 1.0 / (1.0 - use);
    const double below = 1.0 / (1.0 + use);
    add(jerk.piece, row, above - below, above * above + below * below);
  }
  solveForChange();
  double decrease = 0.0;
  for (std::size_t i = 0; i < x_.size(); ++i) decrease -= gradient_[i] * change_[i];
  if (!(decrease > kSmallDecrement * static_cast<double>(x_.size()))) return false;
  const double sum = sumOf(x_, weight);
  double step = 1.0;
  for (int k = 0; k < kMostHalvings; ++k, step *= 0.5) {
    for (std::size_t i = 0; i < x_.size(); ++i) next_[i] = x_[i] + step * change_[i];
    if (sumOf(next_, weight) < sum - kLeastWon * step * decrease) {
      std::swap(x_, next_);
      return true;
    }
  }
  return false;
}

// Minus the gradient over the matrix, as L D L^T.
void SquaredSpeedOptimum::solveForChange() {
  auto& [pivots, near, far] = matrix_;
  const std::size_t first = 2;
  const std::size_t last = x_.size() - 2;  // the end of the coefficients that change
  for (std::size_t i = first; i < last; ++i) {
    double change = -gradient_[i];
    if (i >= first + 1) {
      pivots[i] -= near[i - 1] * near[i - 1] * pivots[i - 1];
      if (i + 1 < last) near[i] -= near[i - 1] * far[i - 1] * pivots[i - 1];
      change -= near[i - 1] * change_[i - 1];
    }
    if (i >= first + 2) {
      pivots[i] -= far[i - 2] * far[i - 2] * pivots[i - 2];
      change -= far[i - 2] * change_[i - 2];
    }
    change_[i] = change;
    near[i] /= pivots[i];
    far[i] /= pivots[i];
  }
  for (std::size_t i = last; i-- > first;) {
    change_[i] /= pivots[i];
    if (i + 1 < last) change_[i] -= near[i] * change_[i + 1];
    if (i + 2 < last) change_[i] -= far[i] * change_[i + 2];
  }
}

void SquaredSpeedOptimum::begin(const std::vector<double>& middles) {
  findPlaces();
  findRows();
  const std::size_t size = lengths_.size();
  x_.assign(size + 2, 0.0);
  next_ = gradient_ = change_ = x_;
  matrix_.fill(x_);
  for (std::size_t i = 1; i + 1 < size; ++i) x_[i + 1] = middles[i];
  gap_ = kFirstGap;
}

void SquaredSpeedOptimum::tighten(std::size_t piece, const LimitUsage& usage) {
  for (std::size_t i = first_jerk_[piece]; i < first_jerk_[piece + 1]; ++i) {
    for (double& each : jerks_[i].rate) each *= usage.jerk;
  }
  // The limits at the end of the piece are those of the next one.
  const std::size_t end = std::min(piece + 2, lengths_.size());
  for (std::size_t i = first_linear_[piece]; i < first_linear_[end]; ++i) {
    Linear& linear = linears_[i];
    const double by = linear.of_speed ? usage.speed * usage.speed : usage.acceleration;
    linear.most *= by;
    linear.least *= by;
  }
}

void SquaredSpeedOptimum::solve() {
  constexpr double kSlower = 0.8;
  while (!std::isfinite(sumOf(x_, 1.0))) {
    for (double& x : x_) x *= kSlower;
  }
  for (double gap = gap_; gap > kLastGap * kRoundedFactor; gap *= kFactorOfGap) {
    const double weight = static_cast<double>(lengths_.size()) / (gap * timeOf(x_));
    for (int i = 0; i < kMostNewtonSteps && improve(weight); ++i) {
    }
  }
  gap_ = kFirstGap * kFactorOfGap;  // a motion that is near to the optimum
}

double SquaredSpeedOptimum::square(std::size_t place) const {
  const std::array<double, 2>& of = places_[place].square;
  return of[0] * x_[place] + of[1] * x_[place + 1];
}

double SquaredSpeedOptimum::acceleration(std::size_t place) const {
  const std::array<double, 2>& of = places_[place].slope;
  return (of[0] * x_[place] + of[1] * x_[place + 1]) / 2.0;
}

// With x'' = 2 p, the speed fulfils v'' = p v: the length is (v0 + v1) tanh(w T/2)/w with w =
// sqrt(p), or with the tangent for p < 0.
double SquaredSpeedOptimum::duration(std::size_t piece) const {
  const double sum = std::sqrt(square(piece)) + std::sqrt(square(piece + 1));
  const double mean = 2.0 * lengths_[piece] / sum;
  if (piece == 0 || piece + 1 == lengths_.size()) return 1.5 * mean;
  const double p = (acceleration(piece + 1) - acceleration(piece)) / lengths_[piece];
  const double y = p * mean * mean / 4.0;
  const double root = std::sqrt(std::abs(y));
  constexpr double kSmall = 1e-4;  // then the next term of the series is y^3/7
  if (std::abs(y) < kSmall) return mean * (1.0 + y * (1.0 / 3.0 + y / 5.0));
  return mean * (y > 0.0 ? std::atanh(root) : std::atan(root)) / root;
}

}  // namespace stepdriver::motion
