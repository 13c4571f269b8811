#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "path.h"

namespace stepdriver::motion {

/// The intervals of a grid that were divided, each into the same number of parts.
struct Division {
  std::vector<std::size_t> intervals;  ///< the indices that they had before, in increasing order
  std::size_t parts = 1;

  /// The index of the first part of one of `intervals`.
  std::size_t firstPartOf(std::size_t which) const {
    return intervals[which] + which * (parts - 1);
  }

  /// Gives each part the values of the interval that was divided.
  ///
  /// @param values `width` of them for each interval or for each place
  template <typename Value>
  void spread(std::vector<Value>& values, std::size_t width = 1) const {
    const auto at = [&](std::size_t index) {
      return values.begin() + static_cast<std::ptrdiff_t>(index * width);
    };
    std::size_t end = values.size() / width;  // what lies before it hasn't been moved yet
    values.resize(values.size() + intervals.size() * (parts - 1) * width);
    // Values are moved from the end on, so that none is overwritten before it is moved.
    for (std::size_t which = intervals.size(); which-- > 0;) {
      const std::size_t begin = intervals[which];
      const std::size_t first = firstPartOf(which);
      std::move_backward(at(begin + 1), at(end), at(first + parts + end - begin - 1));
      for (std::size_t k = parts; k-- > 0;) {
        if (first + k != begin) std::copy(at(begin), at(begin + 1), at(first + k));
      }
      end = begin;
    }
  }
};

/// A path divided into short intervals of its length s. A place separates each from the next one. A
/// straight part is one interval. Only one thread uses it at a time.
class PathGrid {
 public:
  /// How finely a path is divided.
  struct Fineness {
    double most_turn;          ///< [rad] an interval turns by no more
    int parts_of_gentle_half;  ///< the fewest intervals of half a corner that hardly turns
  };
  /// @name Finenesses, by what is even along each interval
  /// @{
  static constexpr Fineness kForSpeed{0.12, 5};
  static constexpr Fineness kForAcceleration{0.28, 2};  ///< the acceleration of each axis
  /// @}

  /// @param begin the parameter of the first segment at which the grid begins
  explicit PathGrid(const Path& path, double begin = 0.0, const Fineness& fineness = kForSpeed);

  struct Interval {
    double length = 0.0;  ///< [unit]
    std::size_t segment = 0;
    bool straight = false;
    double from = 0.0;  ///< the parameters of the segment at the interval's ends
    double to = 0.0;
  };

  /// Divides the intervals that `which` marks, except straight ones, into this many parts each.
  Division divideEach(const std::vector<bool>& which, std::size_t parts);

  /// The same grid with straight intervals divided at these distances from the start.
  ///
  /// @param distances in increasing order
  PathGrid divided(const std::vector<double>& distances) const;
  /// The grid of what lies beyond a distance from its start, which is less than its length.
  PathGrid after(double distance) const;

  std::size_t axes() const { return axes_; }
  std::size_t size() const { return intervals_.size(); }
  /// The first interval that doesn't end before a place; size() if there is none.
  std::size_t firstFrom(const Path::Place& place) const;
  /// How many intervals it may have without needing more memory.
  std::size_t capacity() const { return intervals_.capacity(); }
  const Interval& operator[](std::size_t index) const { return intervals_[index]; }
  /// [unit] The position at the place before an interval; with the index size(), at the end.
  const double* position(std::size_t place) const { return &positions_[place * axes_]; }
  /// Whether the motion stops at a place: at a corner, and at the end.
  bool stopsAt(std::size_t place) const { return stops_[place] != 0; }
  /// The point at the middle parameter of an interval. It is valid until another one is evaluated.
  const PathPoint& evaluateMiddle(std::size_t interval) const {
    const Interval& of = intervals_[interval];
    PathPoint& middle = scratch_.front().point;
    path_.evaluate(of.segment, (of.from + of.to) / 2.0, middle);
    return middle;
  }

  /// The point at a distance from the begin of an interval, with its derivatives with respect to s.
  /// A distance beyond the end of an interval that isn't straight gives its end.
  ///
  /// @return the parameter of the point
  double evaluateAt(std::size_t interval, double distance, PathPoint& point) const;

  /// @name The first two derivatives of the position with respect to s, at the ends of an interval.
  /// The second one jumps at a place if the curvature does; the first one jumps only at a stop.
  /// @{
  const double* firstAtBegin(std::size_t interval) const { return derivative(interval, 0); }
  const double* secondAtBegin(std::size_t interval) const { return derivative(interval, 1); }
  const double* firstAtEnd(std::size_t interval) const { return derivative(interval, 2); }
  const double* secondAtEnd(std::size_t interval) const { return derivative(interval, 3); }
  /// @}

 private:
  // A point of the path with its parameter, and what follows from its derivatives.
  struct Place {
    double parameter = 0.0;
    PathPoint point;
    double rate = 0.0;  // |p'|
  };

  const double* derivative(std::size_t interval, std::size_t which) const {
    return &derivatives_[(4 * interval + which) * axes_];
  }
  void evaluate(std::size_t segment, double parameter, Place& place) const;
  void divide(std::size_t segment, double to, int parts);
  int partsOfCorner(std::size_t segment, double to);
  double turnOf(const Place& begin, const Place& end) const;
  bool tooLong(const Place& begin, const Place& middle, const Place& end) const;
  double lengthOf(const Place& begin, const Place& middle, const Place& end) const;
  void append(std::size_t segment, const Place& begin, const Place& end, double length,
              bool straight);
  void put(std::size_t index, std::size_t segment, const Place& begin, const Place& end,
           double length, bool straight);
  void reserve(std::size_t intervals);
  void withRespectToLength(const Place& place, double* first, double* second) const;

  const Path& path_;
  Fineness fineness_;
  std::size_t axes_;
  std::vector<Interval> intervals_;
  std::vector<double> positions_;
  std::vector<double> derivatives_;  // four vectors for each interval
  std::vector<char> stops_;          // whether the motion stops there, for each place
  mutable std::array<Place, 3> scratch_;
  std::vector<double> ahead_;  // the parameters that divide() has yet to reach
};

}  // namespace stepdriver::motion
