#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "path_timing/acceleration_limited.h"

namespace stepdriver::test {

/// The shortest duration along a curve from rest to rest within limits of velocity, acceleration
/// and jerk, by brute force on a fine grid.
///
/// x = s'^2 at the places of the grid is what is looked for. With differences of three neighbours
/// for x' and x'', each axis has the velocity q' sqrt(x), the acceleration q'' x + q' x'/2 and the
/// jerk sqrt(x) (q''' x + 3/2 q'' x' + 1/2 q' x''). The sum of the duration and of the logarithms
/// of the unused parts of all limits, with falling weights, is minimized by Newton's method, whose
/// matrix has five diagonals. The jerk's limits aren't convex: it is an optimum among similar
/// motions.
class JerkLimitedOptimum {
 public:
  struct Place {
    double distance = 0.0;  ///< [unit] from the start
    double most = 0.0;      ///< [unit^2/s^2] of x
    std::vector<double> first;
    std::vector<double> second;
    std::vector<double> third;
  };

  /// @param places the motion is at rest at the first and at the last one.
  /// @param x [unit^2/s^2] at the places: a motion to begin with, which is slowed down until it is
  ///   within the limits.
  JerkLimitedOptimum(std::vector<Place> places, const std::vector<motion::TimingLimits>& limits,
                     std::vector<double> x)
      : places_(std::move(places)), limits_(limits), x_(std::move(x)) {
    const std::size_t size = places_.size();
    for (std::size_t i = 1; i + 1 < size; ++i) {
      const double before = places_[i].distance - places_[i - 1].distance;
      const double after = places_[i + 1].distance - places_[i].distance;
      const double both = before + after;
      slope_.push_back(
          {-after / (before * both), (after - before) / (before * after), before / (after * both)});
      bend_.push_back({2.0 / (before * both), -2.0 / (before * after), 2.0 / (after * both)});
    }
    x_.front() = x_.back() = 0.0;
    limitFirst(places_[1], places_[1].distance);
    limitFirst(places_[size - 2], places_[size - 1].distance - places_[size - 2].distance);
  }

  /// [s]
  double duration() {
    constexpr double kSlower = 0.8;
    while (!std::isfinite(sumOf(x_, 1.0))) {
      for (double& x : x_) x *= kSlower;
    }
    double count = 0.0;
    forEachSlack(x_, [&](std::size_t /*place*/, double /*slack*/, const auto& /*slope*/) {
      ++count;
      return true;
    });
    constexpr double kFirst = 0.1;
    constexpr double kLast = 2e4;
    constexpr double kFactor = 6.0;
    const double least = count / timeOf(x_);
    for (double weight = kFirst * least; weight < kLast * least; weight *= kFactor) {
      for (int i = 0; i < 40 && improve(weight); ++i) {
      }
    }
    return timeOf(x_);
  }

 private:
  using Three = std::array<double, 3>;

  // The acceleration begins at 0: with the jerk J, s = J t^3/6 and x = (9/2 J s^2)^(2/3).
  void limitFirst(Place& place, double distance) const {
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const double jerk = limits_[j].jerk / std::abs(place.first[j]);
      place.most = std::min(place.most, std::pow(4.5 * jerk * distance * distance, 2.0 / 3.0));
    }
  }

  // In the first and the last part, from and to rest, x grows with the power 4/3 of the distance.
  double factorOf(std::size_t interval) const {
    const bool rests = interval == 0 || interval + 2 == places_.size();
    return (rests ? 3.0 : 2.0) * (places_[interval + 1].distance - places_[interval].distance);
  }
  double timeOf(const std::vector<double>& x) const {
    double time = 0.0;
    for (std::size_t i = 0; i + 1 < x.size(); ++i) {
      time += factorOf(i) / (std::sqrt(x[i]) + std::sqrt(x[i + 1]));
    }
    return time;
  }

  // The unused part of each limit, and its derivatives with respect to x at a place
  // and at its neighbours.
  template <typename Take>
  bool forEachSlack(const std::vector<double>& x, const Take& take) const {
    for (std::size_t i = 1; i + 1 < places_.size(); ++i) {
      if (!(x[i] > 0.0)) return false;
      const Place& place = places_[i];
      const Three& by_slope = slope_[i - 1];
      const Three& by_bend = bend_[i - 1];
      const double root = std::sqrt(x[i]);
      double slope = 0.0;
      double bend = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        slope += by_slope[k] * x[i - 1 + k];
        bend += by_bend[k] * x[i - 1 + k];
      }
      if (!take(i, 1.0 - x[i] / place.most, Three{0.0, -1.0 / place.most, 0.0})) return false;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        const motion::TimingLimits& limits = limits_[j];
        const bool forwards = place.first[j] > 0.0;
        const double most = forwards ? limits.acceleration : limits.deceleration;
        const double least = forwards ? limits.deceleration : limits.acceleration;
        Three high{};
        Three low{};
        for (std::size_t k = 0; k < 3; ++k) {
          const double by = place.first[j] * by_slope[k] / 2.0 + (k == 1 ? place.second[j] : 0.0);
          high[k] = -by / most;
          low[k] = by / least;
        }
        const double acceleration = place.first[j] * slope / 2.0 + place.second[j] * x[i];
        if (!take(i, 1.0 - acceleration / most, high)) return false;
        if (!take(i, 1.0 + acceleration / least, low)) return false;
        if (std::isinf(limits.jerk)) continue;
        const double sum =
            (place.third[j] * x[i] + 1.5 * place.second[j] * slope + 0.5 * place.first[j] * bend) /
            limits.jerk;
        for (std::size_t k = 0; k < 3; ++k) {
          const double by = 1.5 * place.second[j] * by_slope[k] +
                            0.5 * place.first[j] * by_bend[k] + (k == 1 ? place.third[j] : 0.0);
          low[k] = root * by / limits.jerk + (k == 1 ? sum / (2.0 * root) : 0.0);
          high[k] = -low[k];
        }
        if (!take(i, 1.0 - root * sum, high) || !take(i, 1.0 + root * sum, low)) return false;
      }
    }
    return true;
  }

  // Infinite beyond a limit.
  double sumOf(const std::vector<double>& x, double weight) const {
    double logarithms = 0.0;
    const bool within =
        forEachSlack(x, [&](std::size_t /*place*/, double slack, const Three& /*by*/) {
          if (slack > 0.0) logarithms += std::log(slack);
          return slack > 0.0;
        });
    return within ? weight * timeOf(x) - logarithms : std::numeric_limits<double>::infinity();
  }

  // A step of Newton's method, without what isn't convex in the second derivatives of the limits.
  // @return whether it made the sum smaller.
  bool improve(double weight) {
    const std::size_t size = x_.size();
    std::array<std::vector<double>, 3> matrix;
    for (std::vector<double>& diagonal : matrix) diagonal.assign(size, 0.0);
    std::vector<double> gradient(size, 0.0);
    for (std::size_t i = 0; i + 1 < size; ++i) {
      const double a = std::sqrt(x_[i]);
      const double b = std::sqrt(x_[i + 1]);
      const double first = factorOf(i) * weight / ((a + b) * (a + b));
      const double second = 2.0 * first / (a + b);
      if (a > 0.0) {
        gradient[i] -= first / (2.0 * a);
        matrix[0][i] += second / (4.0 * a * a) + first / (4.0 * a * a * a);
      }
      if (b > 0.0) {
        gradient[i + 1] -= first / (2.0 * b);
        matrix[0][i + 1] += second / (4.0 * b * b) + first / (4.0 * b * b * b);
      }
      if (a > 0.0 && b > 0.0) matrix[1][i] += second / (4.0 * a * b);
    }
    forEachSlack(x_, [&](std::size_t place, double slack, const Three& slope) {
      for (std::size_t k = 0; k < 3; ++k) {
        gradient[place - 1 + k] -= slope[k] / slack;
        for (std::size_t l = k; l < 3; ++l) {
          matrix[l - k][place - 1 + k] += slope[k] * slope[l] / (slack * slack);
        }
      }
      return true;
    });
    // x stays 0 at both ends.
    for (const std::size_t end : {std::size_t{0}, size - 1}) {
      gradient[end] = 0.0;
      matrix[0][end] = 1.0;
    }
    matrix[1][0] = matrix[2][0] = matrix[1][size - 2] = matrix[2][size - 3] = 0.0;
    const std::vector<double> change = solve(std::move(matrix), gradient);
    double decrease = 0.0;
    for (std::size_t i = 0; i < size; ++i) decrease -= gradient[i] * change[i];
    if (!(decrease > 1e-3)) return false;
    const double sum = sumOf(x_, weight);
    std::vector<double> next(size);
    double step = 1.0;
    for (int k = 0; k < 60; ++k, step *= 0.6) {
      for (std::size_t i = 0; i < size; ++i) next[i] = x_[i] + step * change[i];
      if (sumOf(next, weight) < sum - 0.1 * step * decrease) {
        x_ = std::move(next);
        return true;
      }
    }
    return false;
  }

  // Minus the right side over a symmetric matrix, given by its diagonals, as L D L^T.
  static std::vector<double> solve(std::array<std::vector<double>, 3> matrix,
                                   const std::vector<double>& right) {
    auto& [pivots, near, far] = matrix;
    std::vector<double> solution(right.size());
    for (std::size_t i = 0; i < right.size(); ++i) {
      solution[i] = -right[i];
      if (i >= 1) {
        pivots[i] -= near[i - 1] * near[i - 1] * pivots[i - 1];
        near[i] -= near[i - 1] * far[i - 1] * pivots[i - 1];
        solution[i] -= near[i - 1] * solution[i - 1];
      }
      if (i >= 2) {
        pivots[i] -= far[i - 2] * far[i - 2] * pivots[i - 2];
        solution[i] -= far[i - 2] * solution[i - 2];
      }
      near[i] /= pivots[i];
      far[i] /= pivots[i];
    }
    for (std::size_t i = right.size(); i-- > 0;) {
      solution[i] /= pivots[i];
      if (i + 1 < right.size()) solution[i] -= near[i] * solution[i + 1];
      if (i + 2 < right.size()) solution[i] -= far[i] * solution[i + 2];
    }
    return solution;
  }

  std::vector<Place> places_;
  const std::vector<motion::TimingLimits>& limits_;
  std::vector<double> x_;
  std::vector<Three> slope_;  // that of x at the places between the ends, from its neighbours
  std::vector<Three> bend_;
};

}  // namespace stepdriver::test
