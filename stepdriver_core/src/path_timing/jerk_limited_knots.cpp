#include "jerk_limited_knots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

// The jerk may change by this part of its limit without a knot.
constexpr double kSmallChange = 0.05;
// A quintic of the duration h with the states of a motion at its ends is off by at most this times
// h^2 times the integral of what the jerk of the motion differs from a constant (the largest value
// of the Peano kernel).
constexpr double kPeanoKernel = 0.0173;
// Part of the resolution by which a quintic may be off for a change of the jerk that was left out.
constexpr double kMostJerkDeviation = 0.01;

// [s] The time after which a part of a smoothed motion has moved by a distance, before it ends.
double timeUntilMoved(const AveragedPart& part, double distance, double duration) {
  double low = 0.0;
  double high = duration;
  double h = duration / 2.0;
  constexpr int kMostSteps = 60;
  for (int i = 0; i < kMostSteps && high - low > 1e-13 * duration; ++i) {
    const double moved =
        h * (part.speed + h * (part.acceleration / 2.0 + h * part.jerk / 6.0)) - distance;
    (moved > 0.0 ? high : low) = h;
    const double speed = part.speed + h * (part.acceleration + h * part.jerk / 2.0);
    const double newton = h - moved / speed;
    if (std::abs(newton - h) <= 1e-14 * duration) break;
    h = newton > low && newton < high ? newton : (low + high) / 2.0;
  }
  return h;
}

class KnotMaker {
 public:
  KnotMaker(const PathGrid& grid, const std::vector<TimingLimits>& limits,
            const std::vector<AveragedPart>& parts, double time, const std::vector<double>& closest,
            double resolution)
      : grid_(grid),
        limits_(limits),
        parts_(parts),
        time_(time),
        each_closest_(closest),
        latest_(closest),
        most_(kMostJerkDeviation * resolution / kPeanoKernel),
        knots_(grid.axes()) {
    for (std::size_t i = latest_.size() - 1; i-- > 0;) {
      latest_[i] = std::max(latest_[i], latest_[i + 1]);
    }
    for (double& each : latest_) each = parts.back().time - each;
    last_ = latest_.front();
  }

  JerkLimitedKnots make() {
    appendPlace(0, parts_.front(), 0.0, 0);
    for (std::size_t k = 0; k + 1 < parts_.size(); ++k) {
      giveWayAt(k);
      beginPart(k);
      const AveragedPart& next = parts_[k + 1];
      while (interval_ + 1 < grid_.size() && begin_ + grid_[interval_].length < next.distance) {
        passInterval(k);
      }
      leave(k, k + 2 < parts_.size() ? next.time : last_);
    }
    appendPlace(grid_.size(), parts_.back(), 0.0, parts_.size() - 1);
    return std::move(knots_);
  }

 private:
  bool isTooClose(double time) const {
    return knots_.size() > 0 && (time - knots_.back().time < closest_ || time > last_);
  }

  // Within a part, the motion passes from the interval that contains it to the next one.
  void passInterval(std::size_t index) {
    const AveragedPart& part = parts_[index];
    const double duration = parts_[index + 1].time - part.time;
    const bool from_straight = grid_[interval_].straight;
    const bool to_straight = grid_[interval_ + 1].straight;
    const bool curved = !from_straight || !to_straight;
    const double moved = begin_ + grid_[interval_].length - part.distance;
    const bool counts = curved || leavesOut() || part.time + duration > last_;
    const double h = counts && moved > 0.0 ? timeUntilMoved(part, moved, duration) : 0.0;
    if (counts) leave(index, part.time + h);
    begin_ += grid_[interval_].length;
    ++interval_;
    last_ = latest_[interval_];
    if (curved && !isTooClose(part.time + h)) {
      appendPlace(interval_, part, h, index);
    } else if (from_straight != to_straight) {
      turns_ = true;
    }
    closest_ = std::max(closest_, each_closest_[interval_]);
  }

  void beginPart(std::size_t index) {
    const AveragedPart& part = parts_[index];
    const bool becomes_even = index > 0 && part.even && !parts_[index - 1].even;
    const double duration = parts_[index + 1].time - part.time;
    const double jump = index > 0 ? jumpBefore(index) : 0.0;
    if (!isSmall(jump, part.time + duration - knots_.back().time) && !isTooClose(part.time)) {
      appendWithin(index - 1, part.time);
    }
    off_ += jump;
    const double since = part.time - knots_.back().time;
    const double change = std::abs(part.jerk - jerk_);
    const bool small = change <= kSmallChange * highestJerk(grid_, interval_, limits_, time_);
    if (small && !becomes_even && isSmall(off_ + change * duration, since + duration)) {
      off_ += change * duration;
    } else if (isTooClose(part.time)) {
      off_ += change * since;
      jerk_ = part.jerk;
    } else {
      appendWithin(index, part.time);
    }
  }

  // [unit/s^2] The jump of the acceleration before a part: the part in which the acceleration
  // changed was shorter than rounded times.
  double jumpBefore(std::size_t index) const {
    const AveragedPart& before = parts_[index - 1];
    const AveragedPart& part = parts_[index];
    return std::abs(part.acceleration - stateOf(before, part.time - before.time).acceleration);
  }

  bool leavesOut() const { return turns_ || off_ > 0.0; }
  bool isSmall(double off, double duration) const { return off * duration * duration <= most_; }

  // Before the motion leaves an interval or a part at a time: what was left out is followed by a
  // state after the shortest time if it makes a difference by now, and what will be left out before
  // the end follows the last time before that.
  void leave(std::size_t index, double time) {
    const double next = std::max(knots_.back().time + closest_, left_);
    const bool differs = turns_ || !isSmall(off_, time - knots_.back().time);
    if (differs && next <= time && next <= last_) appendWithin(index, next);
    if (left_ <= last_ && time > last_ && last_ - knots_.back().time >= closest_ &&
        endsOtherwise(index)) {
      appendWithin(index, last_);
    }
    left_ = time;
  }

  // Whether what follows the last time before the end differs from a part.
  bool endsOtherwise(std::size_t index) const {
    double off = off_;
    for (std::size_t k = index + 1; k + 1 < parts_.size(); ++k) {
      off +=
          jumpBefore(k) + std::abs(parts_[k].jerk - jerk_) * (parts_[k + 1].time - parts_[k].time);
    }
    const bool straight = interval_ + 1 == grid_.size() || grid_[interval_].straight;
    return !straight || !isSmall(off, parts_.back().time - knots_.back().time);
  }

  // Appends a knot within a part, before the end of the interval that contains the motion.
  void appendWithin(std::size_t index, double time) {
    const AveragedPart& part = parts_[index];
    const State state = stateOf(part, time - part.time);
    const double parameter = grid_.evaluateAt(interval_, state.distance - begin_, point_);
    append({time, state.distance, state.speed, interval_, index, parameter, state.acceleration,
            isEven(index, time - part.time)},
           point_.position.data(), point_.first.data(), point_.second.data());
  }

  void appendPlace(std::size_t place, const AveragedPart& part, double h, std::size_t index) {
    const std::size_t before = place == 0 ? 0 : place - 1;
    const double* first = place == 0 ? grid_.firstAtBegin(0) : grid_.firstAtEnd(before);
    const double* second = place == 0 ? grid_.secondAtBegin(0) : grid_.secondAtEnd(before);
    const State state = stateOf(part, h);
    append({part.time + h, state.distance, state.speed, before, index,
            place == 0 ? grid_[0].from : grid_[before].to, state.acceleration, isEven(index, h)},
           grid_.position(place), first, second);
  }

  void append(const JerkLimitedKnots::Knot& knot, const double* position, const double* first,
              const double* second) {
    knots_.append(knot, position, first, second);
    closest_ = each_closest_[interval_];
    jerk_ = parts_[knot.part].jerk;
    off_ = 0.0;
    turns_ = false;
  }

  struct State {
    double distance = 0.0;
    double speed = 0.0;
    double acceleration = 0.0;
  };
  static State stateOf(const AveragedPart& part, double h) {
    return {part.distance + h * (part.speed + h * (part.acceleration / 2.0 + h * part.jerk / 6.0)),
            part.speed + h * (part.acceleration + h * part.jerk / 2.0),
            part.acceleration + h * part.jerk};
  }
  bool isEven(std::size_t index, double h) const {
    return parts_[index].even && (h == 0.0 || parts_[index + 1].even);
  }

  const PathGrid& grid_;
  const std::vector<TimingLimits>& limits_;
  const std::vector<AveragedPart>& parts_;
  double time_;  // [s] the time of the average
  const std::vector<double>& each_closest_;
  std::vector<double> latest_;  // [s] for each interval, the latest time of a knot before the end
  double closest_ = 0.0;        // [s] the least time from the last knot to the next one
  double most_;                 // [unit] the largest off_ times h^2 that is left out
  double last_ = 0.0;  // [s] the latest time of a knot before the end in the current interval
  JerkLimitedKnots knots_;
  PathPoint point_;
  std::size_t interval_ = 0;  // the interval that contains the motion
  double begin_ = 0.0;        // [unit] the begin of that interval
  double left_ = 0.0;         // [s] when the motion last left an interval or a part
  // What has been left out since the last knot: the integral of what the jerk differs from another
  // one, and the end or the begin of a curve.
  double jerk_ = 0.0;  // [unit/s^3]
  double off_ = 0.0;   // [unit/s^2]
  bool turns_ = false;
};

}  // namespace

double highestJerk(const PathGrid& grid, std::size_t interval,
                   const std::vector<TimingLimits>& limits, double time) {
  double highest = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < limits.size(); ++j) {
    const double part =
        std::max(std::abs(grid.firstAtBegin(interval)[j]), std::abs(grid.firstAtEnd(interval)[j]));
    const double acceleration = std::max(limits[j].acceleration, limits[j].deceleration);
    const double jerk = std::min(limits[j].jerk, acceleration / time);
    if (part > 0.0) highest = std::min(highest, jerk / part);
  }
  return highest;
}

JerkLimitedKnots makeKnots(const PathGrid& grid, const std::vector<TimingLimits>& limits,
                           const std::vector<AveragedPart>& parts, double time,
                           const std::vector<double>& closest, double resolution) {
  return KnotMaker(grid, limits, parts, time, closest, resolution).make();
}

}  // namespace stepdriver::motion
