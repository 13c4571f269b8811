#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stepdriver::test {

/// A time at which the position is known: a step is sent when the curve crosses its half-step line.
struct Crossing {
  std::int64_t time_ns = 0;
  double position = 0.0;  ///< [microsteps]
};

/// The highest speed, acceleration and jerk that a sequence of steps proves.
struct Differences {
  double speed = 0.0;         ///< [microsteps/s]
  double acceleration = 0.0;  ///< [microsteps/s^2]
  double jerk = 0.0;          ///< [microsteps/s^3]
};

/// By divided differences of the crossings: n! times the n-th divided difference is the n-th
/// derivative somewhere between the times (the mean value theorem). Each of them is therefore at
/// most the motion's own limit, apart from the effect of rounding the times to nanoseconds.
///
/// @param apart [s] The points of one difference are at least this far apart: rounding adds at most
///   2, 4 and 8 (speed 1 ns) over apart, its square and its cube.
inline Differences differencesOf(const std::vector<Crossing>& crossings, double apart) {
  const auto slope = [](double low, double high, const Crossing& a, const Crossing& b) {
    return (high - low) / (static_cast<double>(b.time_ns - a.time_ns) * 1e-9);
  };
  Differences most;
  const auto take = [](double& highest, double value) {
    highest = value > highest ? value : -value > highest ? -value : highest;
  };
  for (std::size_t first = 0; first < crossings.size(); ++first) {
    std::vector<Crossing> row{crossings[first]};
    for (std::size_t i = first + 1; i < crossings.size() && row.size() < 4; ++i) {
      const auto since = static_cast<double>(crossings[i].time_ns - row.back().time_ns) * 1e-9;
      if (since >= apart) row.push_back(crossings[i]);
    }
    std::vector<double> order;
    order.reserve(row.size());
    for (const Crossing& crossing : row) order.push_back(crossing.position);
    double factorial = 1.0;
    for (std::size_t n = 1; n < row.size(); ++n) {
      for (std::size_t i = 0; i + n < row.size(); ++i) {
        order[i] = slope(order[i], order[i + 1], row[i], row[i + n]);
      }
      factorial *= static_cast<double>(n);
      take(n == 1 ? most.speed : n == 2 ? most.acceleration : most.jerk, factorial * order[0]);
    }
  }
  return most;
}

}  // namespace stepdriver::test
