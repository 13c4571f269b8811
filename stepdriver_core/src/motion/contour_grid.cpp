#include "contour_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kMostRateRatio = 1.3;       // of the parameter's rates in an interval
constexpr double kMostArcDeviation = 0.005;  // of the resolution
constexpr double kLeastPart = 1e-9;          // of a segment
constexpr double kShortest = 1e-7;           // of a segment: not divided further
constexpr double kNoLength = 1e-14;          // of the length of an interval
constexpr int kPartsOfCorner = 5;            // at least, of each half
constexpr int kPartsOfCurve = 4;             // at least

}  // namespace

ContourGrid::ContourGrid(const Contour& contour, double begin, double most_turn)
    : contour_(contour), most_turn_(most_turn), axes_(contour.axes()) {
  ContourPoint start;
  contour.evaluate(0, begin, start);
  positions_ = std::move(start.position);
  stops_.push_back(false);
  for (std::size_t i = 0; i < contour.size(); ++i) {
    giveWay(i);
    const double from = i == 0 ? begin : 0.0;
    const double first = std::max(from, contour.roundedUntil(i));
    const double last = std::max(from, contour.roundedFrom(i));
    if (first > from) divide(i, from, first, kPartsOfCorner);
    if (last - first > kLeastPart) divide(i, first, last, contour.isLine(i) ? 1 : kPartsOfCurve);
    if (last < 1.0) divide(i, last, 1.0, kPartsOfCorner);
    stops_.back() = contour.stopsAfter(i);
  }
}

void ContourGrid::evaluate(std::size_t segment, double parameter, Place& place) const {
  contour_.evaluate(segment, parameter, place.point);
  place.parameter = parameter;
  double sum = 0.0;
  for (const double x : place.point.first) sum += x * x;
  place.rate = std::sqrt(sum);
}

// Into `parts` intervals, or more if they would be too long; one part is straight.
void ContourGrid::divide(std::size_t segment, double from, double to, int parts) {
  Place begin;
  Place end;
  evaluate(segment, from, begin);
  if (parts == 1) {
    evaluate(segment, to, end);
    append(segment, begin, end, begin.rate * (to - from), true);
    return;
  }
  std::vector<double> ahead;  // parameters of places, the next one last
  ahead.reserve(2 * static_cast<std::size_t>(parts));
  for (int i = 0; i < parts; ++i) ahead.push_back(to + (from - to) * i / parts);
  Place middle;
  evaluate(segment, ahead.back(), end);
  while (true) {
    const double half = (begin.parameter + end.parameter) / 2.0;
    evaluate(segment, half, middle);
    if (end.parameter - begin.parameter > kShortest && tooLong(begin, middle, end)) {
      ahead.push_back(half);
      std::swap(end, middle);
      continue;
    }
    append(segment, begin, end, lengthOf(begin, middle, end), false);
    ahead.pop_back();
    if (ahead.empty()) break;
    std::swap(begin, end);
    evaluate(segment, ahead.back(), end);
  }
}

std::vector<std::size_t> ContourGrid::divideEach(const std::vector<bool>& which,
                                                 std::size_t parts) {
  const ContourGrid before = std::move(*this);
  axes_ = before.axes_;
  const auto more =
      (parts - 1) * static_cast<std::size_t>(std::count(which.begin(), which.end(), true));
  intervals_.clear();
  derivatives_.clear();
  intervals_.reserve(before.size() + more);
  derivatives_.reserve(before.derivatives_.size() + 4 * axes_ * more);
  positions_.reserve(before.positions_.size() + axes_ * more);
  positions_.assign(before.position(0), before.position(0) + axes_);
  stops_.assign(1, false);
  std::vector<std::size_t> origins;
  origins.reserve(before.size() + more);
  std::vector<Place> places(2 * parts + 1);  // with the middles of the parts
  for (std::size_t i = 0; i < before.size(); ++i) {
    giveWayAt(i);
    const Interval& interval = before[i];
    if (which[i] && !interval.straight) {
      for (std::size_t k = 0; k < places.size(); ++k) {
        const double part = static_cast<double>(k) / static_cast<double>(places.size() - 1);
        evaluate(interval.segment, interval.from + part * (interval.to - interval.from), places[k]);
      }
      for (std::size_t k = 0; k + 2 < places.size(); k += 2) {
        append(interval.segment, places[k], places[k + 2],
               lengthOf(places[k], places[k + 1], places[k + 2]), false);
        origins.push_back(i);
      }
    } else {
      intervals_.push_back(interval);
      derivatives_.insert(derivatives_.end(), before.firstAtBegin(i),
                          before.firstAtBegin(i) + 4 * axes_);
      positions_.insert(positions_.end(), before.position(i + 1), before.position(i + 1) + axes_);
      stops_.push_back(false);
      origins.push_back(i);
    }
    stops_.back() = before.stopsAt(i + 1);
  }
  return origins;
}

ContourGrid ContourGrid::divided(const std::vector<double>& distances) const {
  ContourGrid made(*this);
  made.intervals_.clear();
  made.derivatives_.clear();
  made.positions_.assign(position(0), position(0) + axes_);
  made.stops_.assign(1, stopsAt(0));
  const auto take = [&](std::size_t of, const Interval& interval, const double* end) {
    made.intervals_.push_back(interval);
    made.derivatives_.insert(made.derivatives_.end(), firstAtBegin(of),
                             firstAtBegin(of) + 4 * axes_);
    made.positions_.insert(made.positions_.end(), end, end + axes_);
    made.stops_.push_back(false);
  };
  ContourPoint point;
  double begin = 0.0;  // distance from the start
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
      take(i, part, point.position.data());
      rest.from = part.to;
      rest.length -= part.length;
      done = at;
    }
    take(i, rest, position(i + 1));
    made.stops_.back() = stopsAt(i + 1);
    begin += intervals_[i].length;
  }
  return made;
}

ContourGrid ContourGrid::after(double distance) const {
  std::size_t first = 0;
  double begin = 0.0;
  while (first + 1 < size() && begin + intervals_[first].length <= distance) {
    begin += intervals_[first++].length;
  }
  ContourGrid made(*this);
  const auto from = static_cast<std::ptrdiff_t>(first);
  const auto width = static_cast<std::ptrdiff_t>(axes_);
  made.intervals_.erase(made.intervals_.begin(), made.intervals_.begin() + from);
  made.positions_.erase(made.positions_.begin(), made.positions_.begin() + from * width);
  made.derivatives_.erase(made.derivatives_.begin(), made.derivatives_.begin() + 4 * from * width);
  made.stops_.erase(made.stops_.begin(), made.stops_.begin() + from);
  made.stops_.front() = false;
  ContourPoint point;
  Interval& cut = made.intervals_.front();
  cut.from = evaluateAt(first, distance - begin, point);
  cut.length -= distance - begin;
  std::copy(point.position.begin(), point.position.end(), made.positions_.begin());
  std::copy(point.first.begin(), point.first.end(), made.derivatives_.begin());
  std::copy(point.second.begin(), point.second.end(), made.derivatives_.begin() + width);
  return made;
}

double ContourGrid::evaluateAt(std::size_t interval, double distance, ContourPoint& point) const {
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
    return of.from + (of.to - of.from) * distance / of.length;
  }
  auto& [begin, middle, end] = scratch_;
  evaluate(of.segment, of.from, begin);
  const double part = std::clamp(distance / of.length, 0.0, 1.0);
  double parameter = of.from + part * (of.to - of.from);
  constexpr int kCorrections = 4;
  for (int i = 0; i < kCorrections; ++i) {
    evaluate(of.segment, (of.from + parameter) / 2.0, middle);
    evaluate(of.segment, parameter, end);
    const double error = lengthOf(begin, middle, end) - distance;
    if (std::abs(error) < kNoLength * of.length) break;
    parameter = std::clamp(parameter - error / end.rate, of.from, of.to);
  }
  evaluate(of.segment, parameter, end);
  point.position = end.point.position;
  withRespectToLength(end, point.first.data(), point.second.data());
  return parameter;
}

bool ContourGrid::tooLong(const Place& begin, const Place& middle, const Place& end) const {
  const auto [least, most] = std::minmax({begin.rate, middle.rate, end.rate});
  if (most > kMostRateRatio * least) return true;
  double first = 0.0;
  double second = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) {
    const double a = begin.point.first[i] / begin.rate;
    const double b = middle.point.first[i] / middle.rate;
    const double c = end.point.first[i] / end.rate;
    first += (b - a) * (b - a);
    second += (c - b) * (c - b);
  }
  const double turn = std::sqrt(first) + std::sqrt(second);
  if (turn > most_turn_) return true;
  // Of a cubic from an arc of this length and turn, at a constant speed.
  const double length = middle.rate * (end.parameter - begin.parameter);
  return length * turn * turn * turn / 384.0 > kMostArcDeviation * contour_.resolution();
}

// Simpson's rule with the derivatives of |p'| at the ends, exact up to the fifth power.
double ContourGrid::lengthOf(const Place& begin, const Place& middle, const Place& end) const {
  double slopes = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) {
    slopes += begin.point.first[i] * begin.point.second[i] / begin.rate -
              end.point.first[i] * end.point.second[i] / end.rate;
  }
  const double h = end.parameter - begin.parameter;
  return h / 30.0 * (7.0 * begin.rate + 16.0 * middle.rate + 7.0 * end.rate) +
         h * h / 60.0 * slopes;
}

void ContourGrid::append(std::size_t segment, const Place& begin, const Place& end, double length,
                         bool straight) {
  intervals_.push_back({length, segment, straight, begin.parameter, end.parameter});
  appendDerivatives(begin);
  appendDerivatives(end);
  positions_.insert(positions_.end(), end.point.position.begin(), end.point.position.end());
  stops_.push_back(false);
}

void ContourGrid::appendDerivatives(const Place& place) {
  derivatives_.resize(derivatives_.size() + 2 * axes_);
  double* first = &derivatives_[derivatives_.size() - 2 * axes_];
  withRespectToLength(place, first, first + axes_);
}

void ContourGrid::withRespectToLength(const Place& place, double* first, double* second) const {
  const ContourPoint& point = place.point;
  double along = 0.0;
  for (std::size_t i = 0; i < axes_; ++i) along += point.first[i] * point.second[i];
  const double square = place.rate * place.rate;
  for (std::size_t i = 0; i < axes_; ++i) {
    first[i] = point.first[i] / place.rate;
    second[i] = (point.second[i] - point.first[i] * (along / square)) / square;
  }
}

}  // namespace stepdriver::motion
