#include "path_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kMostRateRatio = 1.3;  // the ratio of the parameter's rates within an interval
constexpr double kMostArcDeviation = 0.005;  // relative to the resolution
// Relative to a segment, or to the rounding in which a grid begins: a shorter part is left out.
constexpr double kLeastPart = 1e-9;
constexpr double kShortest = 1e-7;  // relative to a segment; it isn't divided further
// Relative to the length of an interval: what is left after such a correction is rounding.
constexpr double kSmallCorrection = 1e-7;
constexpr int kPartsOfCorner = 5;        // the fewest of each half
constexpr double kGentleTurn = 0.1;      // [rad] half of a corner that turns by less is gentle
constexpr int kPartsOfCurve = 4;         // the fewest
constexpr std::size_t kUsualParts = 24;  // the usual number for a segment

}  // namespace

PathGrid::PathGrid(const Path& path, double begin, const Fineness& fineness)
    : path_(path), fineness_(fineness), axes_(path.axes()) {
  reserve(kUsualParts * path.size());
  PathPoint start;
  path.evaluate(0, begin, start);
  positions_.assign(start.position.begin(), start.position.end());
  stops_.push_back(false);
  for (std::size_t i = 0; i < path.size(); ++i) {
    giveWay(i);
    const double from = i == 0 ? begin : 0.0;
    const double first = std::max(from, path.roundedUntil(i));
    const double last = std::max(from, path.roundedFrom(i));
    evaluate(i, from, scratch_.front());
    if (first - from > kLeastPart * first) divide(i, first, partsOfCorner(i, first));
    if (last - first > kLeastPart) divide(i, last, path.isLine(i) ? 1 : kPartsOfCurve);
    if (last < 1.0) {
      // A part that is too short is left out.
      if (scratch_.front().parameter != last) evaluate(i, last, scratch_.front());
      divide(i, 1.0, partsOfCorner(i, 1.0));
    }
    stops_.back() = path.stopsAfter(i);
  }
}

void PathGrid::evaluate(std::size_t segment, double parameter, Place& place) const {
  path_.evaluate(segment, parameter, place.point);
  place.parameter = parameter;
  double sum = 0.0;
  for (const double x : place.point.first) sum += x * x;
  place.rate = std::sqrt(sum);
}

int PathGrid::partsOfCorner(std::size_t segment, double to) {
  const Place& begin = scratch_.front();
  Place& end = scratch_.back();
  evaluate(segment, to, end);
  return turnOf(begin, end) < kGentleTurn ? fineness_.parts_of_gentle_half : kPartsOfCorner;
}

// Divides a segment from the first place in scratch_ to the parameter `to` into `parts` intervals,
// or more if they would be too long. A single part is straight. Afterwards the first place in
// scratch_ is that of `to`.
void PathGrid::divide(std::size_t segment, double to, int parts) {
  auto& [begin, middle, end] = scratch_;
  const double from = begin.parameter;
  if (parts == 1) {
    evaluate(segment, to, end);
    append(segment, begin, end, begin.rate * (to - from), true);
    std::swap(begin, end);
    return;
  }
  // The parameters of the places ahead; the next one is the last element.
  for (int i = 0; i < parts; ++i) ahead_.push_back(to + (from - to) * i / parts);
  evaluate(segment, ahead_.back(), end);
  while (true) {
    const double half = (begin.parameter + end.parameter) / 2.0;
    evaluate(segment, half, middle);
    if (end.parameter - begin.parameter > kShortest && tooLong(begin, middle, end)) {
      ahead_.push_back(half);
      std::swap(end, middle);
      continue;
    }
    append(segment, begin, end, lengthOf(begin, middle, end), false);
    std::swap(begin, end);
    ahead_.pop_back();
    if (ahead_.empty()) break;
    evaluate(segment, ahead_.back(), end);
  }
}

Division PathGrid::divideEach(const std::vector<bool>& which, std::size_t parts) {
  Division division{{}, parts};
  for (std::size_t i = 0; i < size(); ++i) {
    if (which[i] && !intervals_[i].straight) division.intervals.push_back(i);
  }
  division.spread(intervals_);
  division.spread(derivatives_, 4 * axes_);
  division.spread(positions_, axes_);
  division.spread(stops_);
  std::vector<Place> places(2 * parts + 1);  // the ends and the middles of the parts
  for (std::size_t i = 0; i < division.intervals.size(); ++i) {
    giveWayAt(i);
    const std::size_t first = division.firstPartOf(i);
    const Interval interval = intervals_[first];
    const char stops = stops_[first + parts];
    for (std::size_t k = 0; k < places.size(); ++k) {
      const double part = static_cast<double>(k) / static_cast<double>(places.size() - 1);
      evaluate(interval.segment, interval.from + part * (interval.to - interval.from), places[k]);
    }
    for (std::size_t k = 0; k < parts; ++k) {
      const Place* begin = &places[2 * k];
      put(first + k, interval.segment, begin[0], begin[2], lengthOf(begin[0], begin[1], begin[2]),
          false);
    }
    stops_[first + parts] = stops;
  }
  return division;
}

std::size_t PathGrid::firstFrom(const Path::Place& place) const {
  const auto ends_before = [](const Interval& interval, const Path::Place& at) {
    return interval.segment < at.segment ||
           (interval.segment == at.segment && interval.to <= at.parameter);
  };
  return static_cast<std::size_t>(
      std::lower_bound(intervals_.begin(), intervals_.end(), place, ends_before) -
      intervals_.begin());
}

void PathGrid::reserve(std::size_t intervals) {
  intervals_.reserve(intervals);
  derivatives_.reserve(4 * axes_ * intervals);
  positions_.reserve(axes_ * (intervals + 1));
  stops_.reserve(intervals + 1);
}

PathGrid PathGrid::divided(const std::vector<double>& distances) const {
  PathGrid made(*this);
  made.intervals_.clear();
  made.derivatives_.clear();
  made.positions_.assign(position(0), position(0) + axes_);
  made.stops_.assign(1, stopsAt(0));
  const auto keep = [&](std::size_t of, const Interval& interval, const double* end) {
    made.intervals_.push_back(interval);
    made.derivatives_.insert(made.derivatives_.end(), firstAtBegin(of),
                             firstAtBegin(of) + 4 * axes_);
    made.positions_.insert(made.positions_.end(), end, end + axes_);
    made.stops_.push_back(false);
  };
  PathPoint point;
  double begin = 0.0;  // its distance from the start
  auto next = distances.begin();
  for (std::size_t i = 0; i < size(); ++i) {
    giveWayAt(i);
    Interval rest = intervals_[i];
    const double shortest = kLeastPart * rest.length;
    double done = 0.0;
    for (; next != distances.end() && *next < begin + intervals_[i].length - shortest; ++next) {
      const double at = *next - begin;
      if (!rest.straight || at < done + shortest) continue;
      evaluateAt(i, at, point);
      Interval part = rest;
      part.length = at - done;
      part.to = rest.from + (rest.to - rest.from) * part.length / rest.length;
      keep(i, part, point.position.data());
      rest.from = part.to;
      rest.length -= part.length;
      done = at;
    }
    keep(i, rest, position(i + 1));
    made.stops_.back() = stopsAt(i + 1);
    begin += intervals_[i].length;
  }
  return made;
}

PathGrid PathGrid::after(double distance) const {
  std::size_t first = 0;
  double begin = 0.0;
  while (first + 1 < size() && begin + intervals_[first].length <= distance) {
    begin += intervals_[first++].length;
  }
  PathGrid made(*this);
  const auto from = static_cast<std::ptrdiff_t>(first);
  const auto width = static_cast<std::ptrdiff_t>(axes_);
  made.intervals_.erase(made.intervals_.begin(), made.intervals_.begin() + from);
  made.positions_.erase(made.positions_.begin(), made.positions_.begin() + from * width);
  made.derivatives_.erase(made.derivatives_.begin(), made.derivatives_.begin() + 4 * from * width);
  made.stops_.erase(made.stops_.begin(), made.stops_.begin() + from);
  made.stops_.front() = false;
  PathPoint point;
  Interval& cut = made.intervals_.front();
  cut.from = evaluateAt(first, distance - begin, point);
  cut.length -= distance - begin;
  std::copy(point.position.begin(), point.position.end(), made.positions_.begin());
  std::copy(point.first.begin(), point.first.end(), made.derivatives_.begin());
  std::copy(point.second.begin(), point.second.end(), made.derivatives_.begin() + width);
  return made;
}

double PathGrid::evaluateAt(std::size_t interval, double distance, PathPoint& point) const {
  const Interval& of = intervals_[interval];
  point.position.resize(axes_);
  point.first.resize(axes_);
  point.second.resize(axes_);
  if (of.straight) {
    for (std::size_t j = 0; j < axes_; ++j) {
      point.first[j] = firstAtBegin(interval)[j];
      point.position[j] = position(interval)[j] + distance * point.first[j];
      point.second[j] = 0.0;
    }
    return std::clamp(of.from + (of.to - of.from) * distance / of.length, of.from, of.to);
  }
  auto& [begin, middle, end] = scratch_;
  evaluate(of.segment, of.from, begin);
  // The first estimate assumes that the rate changes evenly.
  double change = 0.0;
  for (std::size_t j = 0; j < axes_; ++j) {
    change += begin.point.first[j] * begin.point.second[j] / begin.rate;
  }
  const double ahead = std::clamp(distance, 0.0, of.length);
  const double square = std::max(0.0, begin.rate * begin.rate + 2.0 * change * ahead);
  double parameter = std::min(of.to, of.from + 2.0 * ahead / (begin.rate + std::sqrt(square)));
  constexpr int kCorrections = 4;
  for (int i = 0; i < kCorrections; ++i) {
    evaluate(of.segment, (of.from + parameter) / 2.0, middle);
    evaluate(of.segment, parameter, end);
    const double error = lengthOf(begin, middle, end) - distance;
    parameter = std::clamp(parameter - error / end.rate, of.from, of.to);
    if (std::abs(error) < kSmallCorrection * of.length) break;
  }
  evaluate(of.segment, parameter, end);
  point.position = end.point.position;
  withRespectToLength(end, point.first.data(), point.second.data());
  return parameter;
}

// [rad] The turn from one place to another, almost exactly if it is small.
double PathGrid::turnOf(const Place& begin, const Place& end) const {
  double square = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) {
    const double change = end.point.first[i] / end.rate - begin.point.first[i] / begin.rate;
    square += change * change;
  }
  return std::sqrt(square);
}

bool PathGrid::tooLong(const Place& begin, const Place& middle, const Place& end) const {
  const double least = std::min({begin.rate, middle.rate, end.rate});
  const double most = std::max({begin.rate, middle.rate, end.rate});
  if (most > kMostRateRatio * least) return true;
  const double turn = turnOf(begin, middle) + turnOf(middle, end);
  if (turn > fineness_.most_turn) return true;
  // The deviation of a cubic from an arc of this length and turn, at a constant speed.
  const double length = middle.rate * (end.parameter - begin.parameter);
  return length * turn * turn * turn / 384.0 > kMostArcDeviation * path_.resolution();
}

// Uses Simpson's rule with the derivatives of |p'| at the ends, which is exact up to the fifth
// power.
double PathGrid::lengthOf(const Place& begin, const Place& middle, const Place& end) const {
  double slopes = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) {
    slopes += begin.point.first[i] * begin.point.second[i] / begin.rate -
              end.point.first[i] * end.point.second[i] / end.rate;
  }
  const double h = end.parameter - begin.parameter;
  return h / 30.0 * (7.0 * begin.rate + 16.0 * middle.rate + 7.0 * end.rate) +
         h * h / 60.0 * slopes;
}

void PathGrid::append(std::size_t segment, const Place& begin, const Place& end, double length,
                      bool straight) {
  intervals_.emplace_back();
  derivatives_.resize(derivatives_.size() + 4 * axes_);
  positions_.resize(positions_.size() + axes_);
  stops_.push_back(false);
  put(size() - 1, segment, begin, end, length, straight);
}

void PathGrid::put(std::size_t index, std::size_t segment, const Place& begin, const Place& end,
                   double length, bool straight) {
  intervals_[index] = {length, segment, straight, begin.parameter, end.parameter};
  double* derivatives = &derivatives_[4 * axes_ * index];
  withRespectToLength(begin, derivatives, derivatives + axes_);
  withRespectToLength(end, derivatives + 2 * axes_, derivatives + 3 * axes_);
  std::copy_n(end.point.position.data(), axes_, &positions_[axes_ * (index + 1)]);
  stops_[index + 1] = false;
}

void PathGrid::withRespectToLength(const Place& place, double* first, double* second) const {
  const PathPoint& point = place.point;
  double along = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) along += point.first[i] * point.second[i];
  const double square = place.rate * place.rate;
  for (std::size_t i = 0; i < axes_; ++i) {
    first[i] = point.first[i] / place.rate;
    second[i] = (point.second[i] - point.first[i] * (along / square)) / square;
  }
}

}  // namespace stepdriver::motion
