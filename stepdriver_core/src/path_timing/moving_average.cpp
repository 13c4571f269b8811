#include "moving_average.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kWidthRounding = 1e-9;
constexpr double kUneven = 0.01;        // part of the highest acceleration
constexpr double kEvenRounding = 1e-6;  // part of the time of the average
constexpr int kMostRounds = 40;         // Each round joins maxima at least in pairs.

// A maximum that is being lowered: it lies between two places, and so does its end at each side.
class Maximum {
 public:
  Maximum(const std::vector<SpeedPlace>& places, std::size_t first, std::size_t last)
      : places_(places), left_(first), right_(last), level_(places[first].square) {}

  void lower(double time) {
    while (width(level_) < std::sqrt(level_) * time * (1.0 - kWidthRounding)) {
      while (left_ > 0 && places_[left_ - 1].square == level_) --left_;
      while (right_ + 1 < places_.size() && places_[right_ + 1].square == level_) ++right_;
      if (left_ == 0 || width(level_) >= std::sqrt(level_) * time) return;
      const double before = places_[left_ - 1].square;
      const double after = places_[right_ + 1].square;
      if (before > level_ || after > level_) return;  // It is a minimum.
      const double next = std::max(before, after);
      if (width(next) < std::sqrt(next) * time) {
        level_ = next;
        if (before == next) --left_;
        if (after == next) ++right_;
        continue;
      }
      double low = next;
      for (int i = 0; i < kMostHalvings; ++i) {
        const double middle = (low + level_) / 2.0;
        (width(middle) < std::sqrt(middle) * time ? level_ : low) = middle;
      }
      level_ = low;
      return;
    }
  }

  double level() const { return level_; }
  double begin() const { return begin(level_); }
  double end() const { return end(level_); }
  std::size_t left() const { return left_; }
  std::size_t right() const { return right_; }

 private:
  static constexpr int kMostHalvings = 50;

  double width(double level) const { return end(level) - begin(level); }
  double begin(double level) const {
    return left_ == 0 ? places_[0].distance : cross(left_ - 1, level);
  }
  double end(double level) const {
    return right_ + 1 == places_.size() ? places_[right_].distance : cross(right_, level);
  }
  // The distance at which the speed crosses a level between a place and the next one.
  double cross(std::size_t place, double level) const {
    const SpeedPlace& a = places_[place];
    const SpeedPlace& b = places_[place + 1];
    if (a.square == b.square) return level < a.square ? b.distance : a.distance;
    const double part = std::clamp((level - a.square) / (b.square - a.square), 0.0, 1.0);
    return a.distance + part * (b.distance - a.distance);
  }

  const std::vector<SpeedPlace>& places_;
  std::size_t left_;   // the first place at the level or above it
  std::size_t right_;  // the last one
  double level_;
};

// A motion along its places, at increasing times.
class MotionCursor {
 public:
  MotionCursor(const std::vector<SpeedPlace>& places, const std::vector<double>& times,
               double delay)
      : places_(places), times_(times), delay_(delay) {}

  struct State {
    double distance = 0.0;
    double speed = 0.0;
    double acceleration = 0.0;  // the acceleration after that time
  };

  /// [s] When the acceleration changes next.
  double next() const { return next_ < times_.size() ? times_[next_] + delay_ : kInfinity; }
  /// [s] When the acceleration changed last by more than this.
  double lastChange(double by) {
    for (; seen_ < next_; ++seen_) {
      const double acceleration = accelerationAfter(seen_);
      if (std::abs(acceleration - even_) > by) {
        even_ = acceleration;
        changed_ = times_[seen_] + delay_;
      }
    }
    return changed_;
  }
  State at(double time) {
    while (next() <= time) ++next_;
    if (next_ == 0) return {places_.front().distance, 0.0, 0.0};
    if (next_ == times_.size()) return {places_.back().distance, 0.0, 0.0};
    const SpeedPlace& from = places_[next_ - 1];
    const double acceleration = accelerationAfter(next_ - 1);
    const double passed = time - delay_ - times_[next_ - 1];
    const double begin = std::sqrt(from.square);
    return {from.distance + passed * (begin + passed * acceleration / 2.0),
            begin + passed * acceleration, acceleration};
  }

 private:
  double accelerationAfter(std::size_t place) const {
    if (place + 1 == places_.size()) return 0.0;
    const SpeedPlace& from = places_[place];
    const SpeedPlace& to = places_[place + 1];
    return (to.square - from.square) / (2.0 * (to.distance - from.distance));
  }

  const std::vector<SpeedPlace>& places_;
  const std::vector<double>& times_;
  double delay_;
  std::size_t next_ = 0;
  std::size_t seen_ = 0;  // places that have been looked at for a change
  double even_ = 0.0;     // the acceleration after the last change
  double changed_ = -kInfinity;
};

}  // namespace

Ceiling::Ceiling(std::vector<CeilingSpan> spans) {
  std::sort(spans.begin(), spans.end(),
            [](const CeilingSpan& a, const CeilingSpan& b) { return a.from < b.from; });
  const auto higher = [](const CeilingSpan& a, const CeilingSpan& b) { return a.value > b.value; };
  std::priority_queue<CeilingSpan, std::vector<CeilingSpan>, decltype(higher)> open(higher);
  const auto change = [&](double place) {
    const double value = open.empty() ? kInfinity : open.top().value;
    if (!places_.empty() && places_.back() == place) {
      values_.back() = value;
    } else if (values_.empty() || values_.back() != value) {
      places_.push_back(place);
      values_.push_back(value);
    }
  };
  const auto close = [&](double until) {
    while (!open.empty() && open.top().to <= until) {
      const double place = open.top().to;
      while (!open.empty() && open.top().to <= place) open.pop();
      change(place);
    }
  };
  for (const CeilingSpan& span : spans) {
    close(span.from);
    open.push(span);
    change(span.from);
  }
  close(kInfinity);
}

double Ceiling::lowest(double from, double to) const {
  auto place = std::upper_bound(places_.begin(), places_.end(), from);
  double lowest = kInfinity;
  if (place != places_.begin()) {
    lowest = values_[static_cast<std::size_t>(place - places_.begin()) - 1];
  }
  for (; place != places_.end() && *place < to; ++place) {
    lowest = std::min(lowest, values_[static_cast<std::size_t>(place - places_.begin())]);
  }
  return lowest;
}

std::vector<SpeedPlace> flattenPeaks(std::vector<SpeedPlace> places, double time) {
  for (int round = 0; round < kMostRounds; ++round) {
    std::vector<SpeedPlace> made;
    made.reserve(places.size());
    const auto append = [&](const SpeedPlace& place) {
      if (made.empty() || made.back().distance < place.distance) made.push_back(place);
    };
    bool lowered = false;
    std::size_t next = 0;  // the first place that hasn't been copied
    for (std::size_t i = 0, last = 0; i < places.size(); i = last + 1) {
      giveWayAt(i);
      for (last = i; last + 1 < places.size();) {
        if (places[last + 1].square != places[i].square) break;
        ++last;
      }
      const bool rises = i > 0 && places[i - 1].square < places[i].square;
      const bool falls = last + 1 < places.size() && places[last + 1].square < places[i].square;
      if (!rises || !falls) continue;
      Maximum peak(places, i, last);
      peak.lower(time);
      if (peak.level() >= places[i].square) continue;
      lowered = true;
      for (; next < peak.left(); ++next) append(places[next]);
      append({peak.begin(), peak.level()});
      append({peak.end(), peak.level()});
      next = peak.right() + 1;
    }
    if (!lowered) break;
    for (; next < places.size(); ++next) append(places[next]);
    places = std::move(made);
  }
  return places;
}

std::vector<AveragedPart> movingAverage(const std::vector<SpeedPlace>& places, double time,
                                        bool moves) {
  std::vector<double> times{moves ? -time : 0.0};
  times.reserve(places.size());
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double speeds = std::sqrt(places[i - 1].square) + std::sqrt(places[i].square);
    times.push_back(times.back() + 2.0 * (places[i].distance - places[i - 1].distance) / speeds);
  }
  if (moves) times[1] = 0.0;
  double steepest = 0.0;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double change = std::abs(places[i].square - places[i - 1].square);
    steepest = std::max(steepest, change / (2.0 * (places[i].distance - places[i - 1].distance)));
  }
  MotionCursor front(places, times, 0.0);
  MotionCursor rear(places, times, time);
  std::vector<AveragedPart> made;
  made.reserve(2 * places.size());
  double distance = 0.0;
  for (double now = 0.0; now < kInfinity;) {
    giveWayAt(made.size());
    const double changed = front.lastChange(kUneven * steepest);
    const MotionCursor::State ahead = front.at(now);
    const MotionCursor::State behind = rear.at(now);
    if (!made.empty()) {
      const AveragedPart& before = made.back();
      const double h = now - before.time;
      distance += h * (before.speed + h * (before.acceleration / 2.0 + h * before.jerk / 6.0));
    }
    made.push_back({now, distance, (ahead.distance - behind.distance) / time,
                    (ahead.speed - behind.speed) / time,
                    (ahead.acceleration - behind.acceleration) / time, behind.distance,
                    ahead.distance, behind.acceleration, ahead.acceleration,
                    changed <= now - time * (1.0 - kEvenRounding)});
    now = std::min(front.next(), rear.next());
  }
  made.back().distance = places.back().distance;
  return made;
}

}  // namespace stepdriver::motion
