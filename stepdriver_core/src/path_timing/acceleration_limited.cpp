#include "acceleration_limited.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "geometry/path_grid.h"
#include "give_way.h"
#include "path_speed.h"
#include "profile/errors.h"
#include "profile/profile.h"
#include "reachability.h"

namespace stepdriver::motion {
namespace {

// The largest part of an acceleration by which rounded times and positions change it. The times of
// both ends of a cubic of the duration h are rounded by e each, which changes its acceleration a by
// 6 a e/h, and a position that is rounded by r changes it by 6 r/h^2: knots aren't closer than that
// allows.
constexpr double kMostRounding = 1.5e-4;
// The same part if the axes would move by more than a microstep between such knots.
constexpr double kMostRoundingOfFast = 5e-3;
// After this many plans, the whole motion is slowed down if it still exceeds a limit, or it isn't
// possible if it begins at a speed. A plan changes few intervals after the first ones, and takes
// little time.
constexpr int kMostPlans = 24;
// As a part of a limit: a smaller excess is left for slowing the whole motion down.
constexpr double kSmallExcess = 1e-3;
// Lowered limits change the neighbours too: lowering a few of them by a bit more, once most are
// right, makes fewer plans.
constexpr double kLowerBy = 1.002;

// An interval is divided if it uses no limit to this part, unless it takes less than a small part
// of its segment's time.
constexpr double kFullUse = 0.92;
constexpr double kMostSquareRatio = 1.5;
constexpr double kSmallPart = 0.005;
// If both ends of an interval are checked, and that lowers the speed by this factor, the interval
// is divided, unless it is too short even for that.
constexpr double kMostLoss = 1.02;
constexpr double kSmallestPart = 1e-4;
// If a cubic exceeds a limit by this factor, both ends of its interval are checked, and the
// interval is divided if that is still possible.
constexpr double kPoorCubic = 1.01;
// By how much an interval may take longer or shorter than with a constant acceleration along it, as
// a part of its duration.
constexpr double kMostStretch = 0.1;
constexpr double kMostDeviation = 0.02;  // relative to the resolution
constexpr double kMostLeftOut = 0.01;    // relative to the resolution
// How far a cubic that leaves out knots may be beside the path, relative to the resolution, and the
// parts of its duration at whose ends that is looked at.
constexpr double kMostBeside = 0.05;
constexpr int kParts = 8;
// Where a cubic is farther from it, the motion is slowed down by this factor, at most so many
// times.
constexpr double kSlowerBeside = 1.5;
constexpr int kMostSlowed = 40;
constexpr int kMostDivisions = 4;
constexpr std::size_t kPartsOfDivided = 2;

// The motion on a straight part, from one speed to another: two ramps with a cruise between them.
struct Trapezoid {
  double ramp_up = 0.0;  // [s]
  double way_up = 0.0;   // [unit]
  double cruise = 0.0;   // [s]
  double way_cruise = 0.0;
  double ramp_down = 0.0;  // [s]
  double peak = 0.0;       // [unit/s]

  double duration() const { return ramp_up + cruise + ramp_down; }
};

// @param shortest [s] shorter ramps are lengthened to this if there is room for that.
Trapezoid trapezoidOf(double length, double begin_square, double end_square,
                      const Reachability::Ramp& ramp, double peak_square, double shortest) {
  Trapezoid made;
  made.peak = std::sqrt(peak_square);
  made.ramp_up = (made.peak - std::sqrt(begin_square)) / ramp.up;
  made.ramp_down = (made.peak - std::sqrt(end_square)) / ramp.down;
  made.way_up = (peak_square - begin_square) / (2.0 * ramp.up);
  const double way_down = (peak_square - end_square) / (2.0 * ramp.down);
  made.way_cruise = std::max(0.0, length - made.way_up - way_down);
  made.cruise = made.way_cruise / made.peak;
  // If the speed is too high for the ramp, the motion has to slow down more steeply.
  const double way_left = length - made.way_up;
  if (way_down > way_left) made.ramp_down = 2.0 * way_left / (made.peak + std::sqrt(end_square));
  const auto longer = [&](double time) { return time > 0.0 ? std::max(time, shortest) : 0.0; };
  const double up = longer(made.ramp_up);
  const double down = longer(made.ramp_down);
  const double gentle_up = up * (made.peak + std::sqrt(begin_square)) / 2.0;
  const double gentle_down = down * (made.peak + std::sqrt(end_square)) / 2.0;
  const double gentle_cruise = length - gentle_up - gentle_down;
  const bool is_short = up > made.ramp_up || down > made.ramp_down;
  if (is_short && gentle_cruise > shortest * made.peak) {
    return {up, gentle_up, gentle_cruise / made.peak, gentle_cruise, down, made.peak};
  }
  return made;
}

// The largest shares of their limits that the axes use on a cubic.
struct CubicUsage {
  double acceleration_at_begin = 0.0;
  double acceleration_at_end = 0.0;
  double speed = 0.0;

  double acceleration() const { return std::max(acceleration_at_begin, acceleration_at_end); }
};

// The motion at a planned speed: the durations of the intervals, and its knots. Values that follow
// from the speeds at both ends of an interval are kept until these speeds change.
class Knots {
 public:
  Knots(const Path& path, const PathGrid& grid, const std::vector<TimingLimits>& limits)
      : path_(path),
        grid_(grid),
        limits_(limits),
        resolution_(path.resolution()),
        axes_(grid.axes()) {
    kept_.reserve(grid.capacity());
    kept_.resize(grid.size());
    closest_.resize(grid.size(), 0.0);
  }

  /// Follows a division of the grid by PathGrid::divideEach().
  void regrid(const Division& division) {
    division.spread(kept_);
    division.spread(closest_);
    for (std::size_t i = 0; i < division.intervals.size(); ++i) {
      for (std::size_t k = 0; k < division.parts; ++k) kept_[division.firstPartOf(i) + k] = {};
    }
  }

  void findDurations(const Reachability& speed) {
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      giveWayAt(i);
      const double begin = speed.square(i);
      const double end = speed.square(i + 1);
      Kept& kept = kept_[i];
      const bool changed = begin != kept.begin_square || end != kept.end_square;
      if (changed) kept = {begin, end, std::sqrt(begin), std::sqrt(end)};
      if (grid_[i].straight) {
        kept.duration = trapezoid(i, speed).duration();
      } else if (changed) {
        kept.duration = durationOf(i, kept.begin, kept.end);
      }
    }
  }

  void make(const Reachability& speed) {
    findDurations(speed);
    findClosest();
    knots_.clear();
    planned_.clear();
    inner_.clear();
    // A straight part may have two more knots.
    knots_.reserve(3 * grid_.size());
    planned_.reserve(3 * grid_.size() + 1);
    appendPlace(0, 0.0, kept_[0].begin, 0);
    double time = 0.0;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      giveWayAt(i);
      if (grid_[i].straight) appendStraight(i, speed, time);
      time += kept_[i].duration;
      appendPlace(i + 1, time, kept_[i].end, i);
    }
  }

  double beginSpeed(std::size_t interval) const { return kept_[interval].begin; }
  double endSpeed(std::size_t interval) const { return kept_[interval].end; }
  double duration(std::size_t interval) const { return kept_[interval].duration; }  ///< [s]
  /// Whether there may be a knot within an interval that isn't too close to those at its ends.
  bool hasRoom(std::size_t interval) const {
    return duration(interval) >= 2.0 * closest_[interval];
  }
  /// Whether settle() has been called since the speeds of an interval changed.
  bool isSettled(std::size_t interval) const { return kept_[interval].settled; }
  void settle(std::size_t interval) { kept_[interval].settled = true; }
  /// How much the cubic of an interval that isn't straight uses of the limits.
  const CubicUsage& usageOf(std::size_t interval) {
    Kept& kept = kept_[interval];
    if (!kept.usage) {
      kept.usage = cubicUsage(
          kept.duration, PathSpeed(path_, grid_[interval].segment, grid_[interval].segment),
          [&](std::size_t j) -> Joint {
            return {grid_.position(interval)[j], directionAt(interval)[j] * kept.begin};
          },
          [&](std::size_t j) -> Joint {
            return {grid_.position(interval + 1)[j], directionAt(interval + 1)[j] * kept.end};
          });
    }
    return *kept.usage;
  }

  std::size_t size() const { return knots_.size(); }
  double time(std::size_t knot) const { return knots_[knot].time; }
  std::size_t interval(std::size_t knot) const { return knots_[knot].interval; }
  double position(std::size_t knot, std::size_t axis) const {
    return jointAt(knots_[knot], axis).position;
  }
  double velocity(std::size_t knot, std::size_t axis) const {
    return jointAt(knots_[knot], axis).velocity;
  }
  double parameter(std::size_t knot) const { return knots_[knot].parameter; }
  double speed(std::size_t knot) const { return knots_[knot].speed; }
  /// Whether a knot is a place of the path, or on a straight part of it.
  bool isOnPath(std::size_t knot) const { return knots_[knot].inner == kNone; }
  /// The first interval that contains a part of the way from a knot to the next one.
  std::size_t intervalAfter(std::size_t knot) const {
    const Knot& of = knots_[knot];
    return of.place == kNone || of.place == 0 ? of.interval : of.interval + 1;
  }
  /// Whether the way from the knot before it to a knot is straight.
  bool isStraight(std::size_t knot) const {
    if (knots_[knot].skipped) return false;
    const std::size_t last = interval(knot);
    const std::size_t first = interval(knot - 1);
    const bool whole = first + 1 == last && parameter(knot - 1) == grid_[first].to;
    return grid_[last].straight && (first == last || whole);
  }
  /// Whether the cubic that ends at a knot leaves the path because others, which would be too close
  /// to each other, were left out on its way: to the side of one of them, or beyond all of them.
  bool leavesPath(std::size_t knot) const {
    if (!knots_[knot].skipped) return false;
    const Knot& from = knots_[knot - 1];
    const Knot& to = knots_[knot];
    const auto [first, last] = between(from, to);
    for (std::size_t j = 0; j < axes_; ++j) {
      const double begin = jointAt(from, j).position;
      const double end = jointAt(to, j).position;
      double lowest = std::min(begin, end);
      double highest = std::max(begin, end);
      for (auto left_out = first; left_out != last; ++left_out) {
        const double place = jointAt(*left_out, j).position;
        lowest = std::min(lowest, place);
        highest = std::max(highest, place);
      }
      for (int k = 1; k < kParts; ++k) {
        const double time = from.time + (to.time - from.time) * k / kParts;
        const double place = cubicAt(from, to, time, j).position;
        if (std::max(lowest - place, place - highest) > kMostBeside * resolution_) return true;
      }
    }
    return std::any_of(first, last,
                       [&](const Knot& left_out) { return isBeside(from, to, left_out); });
  }
  /// [s] The time of the last knot that isn't after a place.
  double timeAt(std::size_t place) const {
    const auto later = std::lower_bound(
        knots_.begin() + 1, knots_.end(), place,
        [](const Knot& knot, std::size_t wanted) { return knot.interval < wanted; });
    return (later - 1)->time;
  }

  /// How much the cubic that ends at a knot uses of the limits.
  CubicUsage usageBefore(std::size_t knot) {
    const std::size_t place = knots_[knot].place;
    const bool whole = place != kNone && knots_[knot - 1].place + 1 == place;
    if (whole && !grid_[place - 1].straight) return usageOf(place - 1);
    const std::size_t last = interval(knot);
    const std::size_t first = std::min(intervalAfter(knot - 1), last);
    return cubicUsage(
        time(knot) - time(knot - 1), PathSpeed(path_, grid_[first].segment, grid_[last].segment),
        [&](std::size_t j) -> Joint {
          return {position(knot - 1, j), velocity(knot - 1, j)};
        },
        [&](std::size_t j) -> Joint {
          return {position(knot, j), velocity(knot, j)};
        });
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  // What is known about an interval.
  struct Kept {
    double begin_square = -1.0;  // [unit^2/s^2]
    double end_square = -1.0;
    double begin = 0.0;  // [unit/s]
    double end = 0.0;
    double duration = 0.0;  // [s]
    std::optional<CubicUsage> usage = {};
    bool settled = false;
  };
  struct Knot {
    double time;
    std::size_t interval;  // the interval of the grid that ends at the knot or contains it
    std::size_t place;     // kNone within an interval
    double way;            // [unit] from the begin of a straight part
    double parameter;
    double speed;
    bool rests = false;         // the motion rests there, at a place
    std::size_t inner = kNone;  // the first of its states, within an interval that isn't straight
    bool skipped = false;       // whether knots were left out between the knot before and this one
  };
  struct Joint {
    double position;
    double velocity;
  };

  // @param from, to return the joint of an axis at the begin and at the end.
  template <typename From, typename To>
  CubicUsage cubicUsage(double duration, PathSpeed path_speed, const From& from,
                        const To& to) const {
    CubicUsage usage;
    const double rate = 1.0 / duration;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const Joint from_joint = from(j);
      const Joint to_joint = to(j);
      const double v0 = from_joint.velocity;
      const double v1 = to_joint.velocity;
      const double mean = (to_joint.position - from_joint.position) * rate;
      const double begin = (6.0 * mean - 4.0 * v0 - 2.0 * v1) * rate;
      const double end = (2.0 * v0 + 4.0 * v1 - 6.0 * mean) * rate;
      const int direction = directionOf(v0, v1);
      const auto part = [&](double a) {
        return std::abs(a) / accelerationTowards(limits_[j], direction, a > 0.0 ? 1 : -1);
      };
      usage.acceleration_at_begin = std::max(usage.acceleration_at_begin, part(begin));
      usage.acceleration_at_end = std::max(usage.acceleration_at_end, part(end));
      double speed = std::max(std::abs(v0), std::abs(v1));
      if (begin * end < 0.0) {
        // The time at which the acceleration changes its sign, as a part of the duration.
        const double turn = begin / (begin - end);
        speed = std::max(speed, std::abs(v0 + begin * turn * duration / 2.0));
      }
      usage.speed = std::max(usage.speed, speed / limits_[j].speed);
      if (path_speed.isLimited()) {
        path_speed.include(
            j, [=](double u) { return v0 + u * duration * (begin + u * (end - begin) / 2.0); });
      }
    }
    if (path_speed.isLimited()) usage.speed = std::max(usage.speed, path_speed.usage());
    return usage;
  }

  // [s] The duration with which the accelerations at both ends of the cubic keep to their limits.
  // It is the one closest to T = 2 length/(begin + end), the duration with a constant s''. With the
  // duration T (1 + e), the accelerations are a - 6 e way/T^2 at the begin and b + 6 e way/T^2 at
  // the end, except for terms of e^2. If there is no such duration, the excess is the same at both
  // limits.
  double durationOf(std::size_t interval, double begin, double end) const {
    const double even = 2.0 * grid_[interval].length / (begin + end);
    const double rate = 1.0 / even;
    double least = -kMostStretch;
    double most = kMostStretch;
    for (std::size_t j = 0; j < axes_; ++j) {
      const double way = grid_.position(interval + 1)[j] - grid_.position(interval)[j];
      const double v0 = directionAt(interval)[j] * begin;
      const double v1 = directionAt(interval + 1)[j] * end;
      const double slope = 6.0 * way * rate * rate;
      const double at_begin = slope - (4.0 * v0 + 2.0 * v1) * rate;
      const double at_end = (2.0 * v0 + 4.0 * v1) * rate - slope;
      const int direction = directionOf(v0, v1);
      const double up = accelerationTowards(limits_[j], direction, 1);
      const double down = -accelerationTowards(limits_[j], direction, -1);
      if (std::abs(slope) * kMostStretch < kSmallExcess * up) continue;
      const double with = slope > 0.0 ? up : down;
      const double against = slope > 0.0 ? down : up;
      const double by = 1.0 / slope;
      least = std::max(least, std::max((at_begin - with) * by, (against - at_end) * by));
      most = std::min(most, std::min((at_begin - against) * by, (with - at_end) * by));
    }
    const double stretch = least > most ? (least + most) / 2.0 : std::clamp(0.0, least, most);
    return even * (1.0 + std::clamp(stretch, -kMostStretch, kMostStretch));
  }

  Trapezoid trapezoid(std::size_t interval, const Reachability& speed) const {
    constexpr double kRounding = 1.001;  // allows for the rounding of differences of times
    return trapezoidOf(grid_[interval].length, speed.square(interval), speed.square(interval + 1),
                       speed.ramp(interval), speed.peakSquare(interval),
                       kRounding * closest_[interval]);
  }

  void appendStraight(std::size_t interval, const Reachability& speed, double time) {
    const Trapezoid made = trapezoid(interval, speed);
    kept_[interval].duration = made.duration();
    appendOnLine(interval, time + made.ramp_up, made.way_up, made.peak);
    appendOnLine(interval, time + made.ramp_up + made.cruise, made.way_up + made.way_cruise,
                 made.peak);
  }

  void appendOnLine(std::size_t interval, double time, double way, double speed) {
    append(onLine(interval, time, way, speed));
  }

  Knot onLine(std::size_t interval, double time, double way, double speed) const {
    const PathGrid::Interval& of = grid_[interval];
    const double part = std::min(1.0, way / of.length);
    return {time, interval, kNone, way, of.from + part * (of.to - of.from), speed};
  }

  void appendPlace(std::size_t place, double time, double speed, std::size_t interval) {
    const double parameter = place == 0 ? grid_[0].from : grid_[interval].to;
    append({time, interval, place, 0.0, parameter, speed, speed == 0.0});
  }

  // If knots are too close to each other, only the first one stays, or one at rest, or one at a
  // place at which other axes begin to move, which need more time between knots, or less: what
  // happens in that time must not be left out of the other ones. If the others make a difference,
  // they are replaced by a state of the same motion at the shortest time from the one that stays.
  // What is left out is then only how the axes move in that time; before and after it, the motion
  // is as planned.
  void append(const Knot& next) {
    planned_.push_back(next);
    if (knots_.empty()) return push(next);
    const bool stays = next.rests || mayReplaceLast(next);
    if (stays && next.time - knots_.back().time < closestBefore(next)) return appendInstead(next);
    replaceLeftOut(next, stays);
    if (next.time - knots_.back().time >= closestBefore(next)) push(next);
  }

  void push(const Knot& next) {
    bool skips = false;
    if (!knots_.empty()) {
      const auto [first, last] = between(knots_.back(), next);
      skips = first != last;
    }
    knots_.push_back(next);
    knots_.back().skipped = skips;
  }

  // Whether a knot is where the shortest time between knots changes, and isn't too close to the one
  // before the last one.
  bool mayReplaceLast(const Knot& next) const {
    const bool changes = next.place != kNone && next.place < grid_.size() &&
                         closest_[next.place] != closest_[next.interval];
    if (!changes || knots_.size() < 2 || knots_.back().rests) return false;
    const std::size_t before = knots_.size() - 2;
    return next.time - knots_[before].time >= closestBetween(before, next);
  }

  // @pre the knot is too close to the last one, which it replaces unless the motion rests there.
  void appendInstead(const Knot& next) {
    if (knots_.size() > 1 && !knots_.back().rests) {
      knots_.pop_back();
      const double closest = closestBefore(next);
      const bool has_room = next.time - knots_.back().time >= 2.0 * closest;
      if (has_room && leavesOutWhatMatters(next)) {
        const Knot last = plannedAt(next.time - closest);
        replaceLeftOut(last, true);
        push(last);
      }
    }
    push(next);
  }

  // If the knots that have been left out since the last one make a difference, they are followed by
  // a state after the shortest time. @param stays whether there must be as much time after it.
  void replaceLeftOut(const Knot& next, bool stays) {
    const double closest = closestBefore(next);
    const double since = next.time - knots_.back().time;
    if (since < (stays ? 2.0 : 1.0) * closest || !leavesOutWhatMatters(next)) return;
    push(plannedAt(knots_.back().time + closest));
  }

  // The planned knots after one and before another one.
  using Planned = std::vector<Knot>::const_iterator;
  std::pair<Planned, Planned> between(const Knot& from, const Knot& to) const {
    const auto first = std::upper_bound(planned_.begin(), planned_.end(), from.time,
                                        [](double time, const Knot& of) { return time < of.time; });
    const auto last = std::lower_bound(first, planned_.end(), to.time,
                                       [](const Knot& of, double time) { return of.time < time; });
    return {first, last};
  }
  bool leavesOutWhatMatters(const Knot& next) const {
    const auto [first, last] = between(knots_.back(), next);
    return std::any_of(
        first, last, [&](const Knot& left_out) { return matters(knots_.back(), left_out, next); });
  }

  // The state of the planned motion at a time. @pre it is after the first knot and before the last.
  Knot plannedAt(double time) {
    const auto to = std::lower_bound(planned_.begin() + 1, planned_.end() - 1, time,
                                     [](const Knot& of, double at) { return of.time < at; });
    return within(*(to - 1), *to, time);
  }

  // Whether the cubic between two knots is off by more than a small part of the resolution because
  // a knot between them is left out. If the cubic is off by dp and dv there, it is off by up to dp
  // + 4/27 h dv in the time h before or after that.
  bool matters(const Knot& from, const Knot& left_out, const Knot& to) const {
    const double longest = std::max(left_out.time - from.time, to.time - left_out.time);
    for (std::size_t j = 0; j < axes_; ++j) {
      const Joint is = cubicAt(from, to, left_out.time, j);
      const Joint wanted = jointAt(left_out, j);
      const double most = std::abs(is.position - wanted.position) +
                          4.0 / 27.0 * longest * std::abs(is.velocity - wanted.velocity);
      if (most > kMostLeftOut * resolution_) return true;
    }
    return false;
  }

  // Whether the cubic between two knots passes one that is left out between them at a distance, at
  // a right angle to the path.
  bool isBeside(const Knot& from, const Knot& to, const Knot& left_out) const {
    const double* direction = grid_.firstAtEnd(left_out.interval);
    double square = 0.0;
    double along = 0.0;
    for (std::size_t j = 0; j < axes_; ++j) {
      const double off =
          cubicAt(from, to, left_out.time, j).position - jointAt(left_out, j).position;
      square += off * off;
      along += off * direction[j];
    }
    const double most = kMostBeside * resolution_;
    return square - along * along > most * most;
  }

  // The state of an axis on the cubic between two knots.
  Joint cubicAt(const Knot& from, const Knot& to, double time, std::size_t axis) const {
    const double whole = to.time - from.time;
    const double passed = time - from.time;
    const Joint begin = jointAt(from, axis);
    const Joint end = jointAt(to, axis);
    const double mean = (end.position - begin.position) / whole;
    const double a = (6.0 * mean - 4.0 * begin.velocity - 2.0 * end.velocity) / whole;
    const double jerk = 6.0 * (begin.velocity + end.velocity - 2.0 * mean) / (whole * whole);
    return {begin.position + passed * (begin.velocity + passed * (a / 2.0 + passed * jerk / 6.0)),
            begin.velocity + passed * (a + passed * jerk / 2.0)};
  }

  // The state at a time between two neighbouring knots.
  Knot within(const Knot& from, const Knot& to, double time) {
    const double whole = to.time - from.time;
    const double passed = time - from.time;
    const double speed = from.speed + (to.speed - from.speed) * (passed / whole);
    const std::size_t interval = to.interval;
    if (grid_[interval].straight) {
      const bool both = from.place == kNone && from.interval == interval;
      const double begin = both ? from.way : 0.0;
      return onLine(interval, time, begin + passed * (from.speed + speed) / 2.0, speed);
    }
    const double begin = from.interval == interval ? from.parameter : grid_[interval].from;
    Knot made{time, interval, kNone, 0.0, begin + (to.parameter - begin) * (passed / whole), speed};
    made.inner = inner_.size();
    for (std::size_t j = 0; j < axes_; ++j) inner_.push_back(cubicAt(from, to, time, j));
    return made;
  }

  Joint jointAt(const Knot& knot, std::size_t axis) const {
    if (knot.inner != kNone) return inner_[knot.inner + axis];
    if (knot.place == kNone) {
      const double direction = grid_.firstAtBegin(knot.interval)[axis];
      return {grid_.position(knot.interval)[axis] + direction * knot.way, direction * knot.speed};
    }
    const double* direction = directionAt(knot.place);
    return {grid_.position(knot.place)[axis], direction[axis] * knot.speed};
  }

  // The direction of the motion at a place. Where the path turns by less than what counts as a
  // corner, it is the one before the place.
  const double* directionAt(std::size_t place) const {
    return place > 0 ? grid_.firstAtEnd(place - 1) : grid_.firstAtBegin(0);
  }

  // Finds how close knots in each interval may be, see kMostRounding. An axis that stands still in
  // it isn't rounded.
  void findClosest() {
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    double duration = 0.0;
    for (const Kept& kept : kept_) duration += kept.duration;
    const double time = 6.0 * std::max(0.5e-9, 2.0 * kEpsilon * duration);
    std::vector<double> rounded(axes_, 0.0);  // [s] for each axis
    for (std::size_t j = 0; j < axes_; ++j) {
      double farthest = 0.0;
      for (std::size_t i = 0; i <= grid_.size(); ++i) {
        farthest = std::max(farthest, std::abs(grid_.position(i)[j]));
      }
      const double least = std::min(limits_[j].acceleration, limits_[j].deceleration);
      rounded[j] = std::sqrt(6.0 * 2.0 * kEpsilon * farthest / (kMostRounding * least));
    }
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      double closest = time / kMostRounding;
      double least = time / kMostRoundingOfFast;
      for (std::size_t j = 0; j < axes_; ++j) {
        if (!movesIn(i, j)) continue;
        const double most = std::max(limits_[j].acceleration, limits_[j].deceleration);
        closest = std::min(closest, std::sqrt(resolution_ / most));
        least = std::max(least, rounded[j]);
      }
      closest_[i] = std::max(closest, least);
    }
  }

  bool movesIn(std::size_t interval, std::size_t axis) const {
    return grid_.position(interval)[axis] != grid_.position(interval + 1)[axis] ||
           grid_.firstAtBegin(interval)[axis] != 0.0 || grid_.firstAtEnd(interval)[axis] != 0.0;
  }

  // [s] In the intervals from the last knot to one that isn't in the list yet.
  double closestBefore(const Knot& next) const { return closestBetween(knots_.size() - 1, next); }
  // [s] In the intervals from a knot to one that isn't in the list yet.
  double closestBetween(std::size_t knot, const Knot& next) const {
    double closest = 0.0;
    for (std::size_t i = std::min(intervalAfter(knot), next.interval); i <= next.interval; ++i) {
      closest = std::max(closest, closest_[i]);
    }
    return closest;
  }

  const Path& path_;
  const PathGrid& grid_;
  const std::vector<TimingLimits>& limits_;
  double resolution_;  // [unit] the path's resolution
  std::size_t axes_;
  std::vector<Kept> kept_;  // for each interval
  std::vector<Knot> knots_;
  std::vector<Knot> planned_;  // all knots, also those that are left out
  std::vector<Joint> inner_;   // for each axis, at some of the knots
  // [s] The least time between knots in each interval, except between two at rest; 0 in a first
  // plan.
  std::vector<double> closest_;
};

// The factors by which limits are exceeded; 1 if they aren't.
struct Excess {
  double acceleration = 1.0;
  double speed = 1.0;
};

// Whether an interval is so long that the motion isn't close to any limit at one of its ends, or
// that the highest speed differs much between them: a motion that is as fast as possible is at one
// of its limits everywhere.
bool wastesTime(const Reachability& speed, std::size_t interval, const CubicUsage& usage) {
  const double begin = speed.square(interval);
  const double end = speed.square(interval + 1);
  const double begin_use = begin / speed.capAtBegin(interval);
  const double end_use = end / speed.capAtEnd(interval);
  if (std::min(begin_use, end_use) > kFullUse)
    return std::max(begin, end) > kMostSquareRatio * std::min(begin, end);
  return std::min(std::max(usage.acceleration_at_begin, begin_use),
                  std::max(usage.acceleration_at_end, end_use)) < kFullUse;
}

// How far the cubic of an interval may be from the path [unit] if its curvature changes evenly.
// Let L be its length, b the angle by which it turns, and r = (v1 - v0)/(v1 + v0) for the speeds at
// its ends. The fourth derivative of q(s(t)) with constant s'' and curvature is 3 q'' s''^2 +
// 6 q''' s'' s'^2 + q'''' s'^4, and the cubic deviates by T^4/384 of that.
double evenDeviation(const PathGrid& grid, std::size_t interval, double begin, double end) {
  double square = 0.0;
  for (std::size_t j = 0; j < grid.axes(); ++j) {
    const double change = grid.firstAtEnd(interval)[j] - grid.firstAtBegin(interval)[j];
    square += change * change;
  }
  const double r = std::abs(end - begin) / (end + begin);
  const double b = std::sqrt(square);
  return grid[interval].length * b * (r * r + b * r + b * b / 12.0) / 32.0;
}

// How far the middle of that cubic is from the path [unit], at a right angle to the path's
// direction in the middle of the interval.
double middleDeviation(const PathGrid& grid, std::size_t interval, double begin, double end,
                       double duration) {
  const PathPoint& middle = grid.evaluateMiddle(interval);
  const double eighth = duration / 8.0;
  double off_square = 0.0;
  double along = 0.0;
  double rate_square = 0.0;
  for (std::size_t j = 0; j < grid.axes(); ++j) {
    const double change =
        grid.firstAtBegin(interval)[j] * begin - grid.firstAtEnd(interval)[j] * end;
    const double off = (grid.position(interval)[j] + grid.position(interval + 1)[j]) / 2.0 +
                       eighth * change - middle.position[j];
    off_square += off * off;
    along += off * middle.first[j];
    rate_square += middle.first[j] * middle.first[j];
  }
  return std::sqrt(std::max(0.0, off_square - along * along / rate_square));
}

// Whether an interval deviates or wastes time. An interval that takes only a small part of its
// segment's time doesn't count as wasteful.
bool isLong(std::size_t interval, double part, double deviation, const PathGrid& grid,
            Reachability& speed, Knots& knots) {
  if (part >= kSmallestPart && speed.lossOfBothEnds(interval) > kMostLoss) return true;
  if (part >= kSmallPart && wastesTime(speed, interval, knots.usageOf(interval))) return true;
  const double begin = knots.beginSpeed(interval);
  const double end = knots.endSpeed(interval);
  return evenDeviation(grid, interval, begin, end) > deviation ||
         middleDeviation(grid, interval, begin, end, knots.duration(interval)) > deviation;
}

void divide(const std::vector<bool>& which, PathGrid& grid, Reachability& speed, Knots& knots) {
  const Division division = grid.divideEach(which, kPartsOfDivided);
  speed.regrid(division);
  knots.regrid(division);
}

// Divides the intervals that are too long, and those whose cubics are poor.
bool divideLong(double deviation, PathGrid& grid, Reachability& speed, Knots& knots) {
  std::vector<bool> divided(grid.size(), false);
  // The durations of the segments.
  std::vector<double> times(grid[grid.size() - 1].segment + 1, 0.0);
  for (std::size_t i = 0; i < grid.size(); ++i) times[grid[i].segment] += knots.duration(i);
  bool any = false;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    giveWayAt(i);
    if (grid[i].straight || knots.isSettled(i)) continue;
    const bool poor = knots.usageOf(i).acceleration() > kPoorCubic;
    if (poor) speed.checkBothEnds(i);
    const double part = knots.duration(i) / times[grid[i].segment];
    if (poor || isLong(i, part, deviation, grid, speed, knots)) {
      divided[i] = any = true;
    } else {
      knots.settle(i);
    }
  }
  if (any) divide(divided, grid, speed, knots);
  return any;
}

// Lowers the limits of the intervals of the cubics that exceed them, or has both ends of them
// checked, and marks those as divided; returns the largest excess.
Excess lowerLimits(double by_more, double poor, const PathGrid& grid, Reachability& speed,
                   Knots& knots, std::vector<bool>& divided) {
  Excess worst;
  divided.assign(grid.size(), false);
  for (std::size_t i = 1; i < knots.size(); ++i) {
    const CubicUsage usage = knots.usageBefore(i);
    const Excess excess{std::max(1.0, usage.acceleration()), std::max(1.0, usage.speed)};
    worst.acceleration = std::max(worst.acceleration, excess.acceleration);
    worst.speed = std::max(worst.speed, excess.speed);
    if (excess.acceleration == 1.0 && excess.speed == 1.0) continue;
    const std::size_t last = knots.interval(i);
    const std::size_t first = std::min(knots.intervalAfter(i - 1), last);
    const auto by = [&](double factor) { return factor > 1.0 ? factor * by_more : 1.0; };
    for (std::size_t k = first; k <= last; ++k) {
      const bool checks = excess.acceleration > poor && !grid[k].straight && speed.checkBothEnds(k);
      speed.lower(k, checks ? 1.0 : by(excess.acceleration), by(excess.speed));
      divided[k] = divided[k] || checks;
    }
  }
  return worst;
}

// Lowers the speeds in the curves of which cubics leave the path because knots were left out.
// @return whether there are any
bool slowDownBeside(const PathGrid& grid, Reachability& speed, const Knots& knots) {
  bool any = false;
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (!knots.leavesPath(i)) continue;
    const std::size_t last = knots.interval(i);
    for (std::size_t k = std::min(knots.intervalAfter(i - 1), last); k <= last; ++k) {
      const double highest = std::max(knots.beginSpeed(k), knots.endSpeed(k)) / kSlowerBeside;
      if (grid[k].straight || highest == 0.0 || knots.hasRoom(k)) continue;
      speed.restrict(k, highest * highest, std::numeric_limits<double>::infinity());
      any = true;
    }
  }
  return any;
}

// The same motion, slower by a factor, at times of whole nanoseconds.
std::vector<TimingKnot> slowedDown(const Knots& knots, const PathGrid& grid, double factor,
                                   double ago) {
  const double last = knots.time(knots.size() - 1) * factor;
  if (!(last < Profile::kLongest)) {
    throw TooLong("the motion along the path would take longer than 4e9 s");
  }
  std::vector<TimingKnot> made;
  made.reserve(knots.size());
  for (std::size_t i = 0; i < knots.size(); ++i) {
    const double time = knots.time(i) * factor - ago;
    TimingKnot& knot = made.emplace_back();
    knot.time_ns = std::llround(time * 1e9);
    const double later = static_cast<double>(knot.time_ns) * 1e-9 - time;
    knot.segment = grid[knots.interval(i)].segment;
    knot.parameter = knots.parameter(i);
    knot.speed = knots.speed(i) / factor;
    knot.may_begin = knots.isOnPath(i);
    knot.straight = i + 1 < knots.size() && knots.isStraight(i + 1);
    knot.positions.resize(grid.axes());
    knot.velocities.resize(grid.axes());
    for (std::size_t j = 0; j < grid.axes(); ++j) {
      const double velocity = knots.velocity(i, j) / factor;
      knot.positions[j] = knots.position(i, j) + velocity * later;
      knot.velocities[j] = velocity;
    }
  }
  return made;
}

// The result of planning: the largest part of a limit that the motion uses if that is more than 1,
// and the factor by which the whole motion has to be slowed down for that.
struct Outcome {
  double excess = 1.0;
  double slowdown = 1.0;
  double settled = 0.0;  // [s] see PathTiming; for the motion before it is slowed down
};

Outcome planKnots(const Path& path, const std::vector<TimingLimits>& limits, double begin_speed,
                  PathGrid& grid, Knots& knots) {
  Reachability speed(path, grid, limits, begin_speed * begin_speed, CheckedAcceleration::kMean);
  for (int i = 0; i < kMostDivisions; ++i) {
    speed.plan();
    knots.findDurations(speed);
    if (!divideLong(kMostDeviation * path.resolution(), grid, speed, knots)) break;
  }
  std::vector<bool> divided(grid.size(), false);
  int slowed = 0;
  for (int plans = 1;; ++plans) {
    divide(divided, grid, speed, knots);
    speed.plan();
    knots.make(speed);
    while (slowed < kMostSlowed && slowDownBeside(grid, speed, knots)) {
      ++slowed;
      speed.plan();
      knots.make(speed);
    }
    const bool first = plans == 1;
    // Lowering the mean of an interval whose cubic still exceeds a limit by little may move the
    // excess from one of its ends to the other one for ever.
    const double poor = first ? kPoorCubic : 1.0;
    const Excess excess = lowerLimits(first ? 1.0 : kLowerBy, poor, grid, speed, knots, divided);
    Outcome outcome{std::max(excess.acceleration, excess.speed)};
    if (outcome.excess > 1.0 + kSmallExcess && plans < kMostPlans) continue;
    // A motion from a speed can't be slowed down.
    if (!(begin_speed > 0.0))
      outcome.slowdown = std::max(std::sqrt(excess.acceleration), excess.speed);
    outcome.settled = knots.timeAt(speed.settledUntil(grid.firstFrom(path.openFrom())));
    return outcome;
  }
}

}  // namespace

PathTiming planAccelerationLimited(const Path& path, const std::vector<TimingLimits>& limits,
                                   const TimingStart& begin) {
  PathTiming plan;
  PathGrid grid(path, begin.parameter, PathGrid::kForAcceleration);
  if (begin.speed > 0.0 && grid.stopsAt(0)) {
    plan.excess = std::numeric_limits<double>::infinity();
    return plan;
  }
  Knots knots(path, grid, limits);
  const Outcome outcome = planKnots(path, limits, begin.speed, grid, knots);
  if (begin.speed > 0.0) {
    plan.excess = outcome.excess;
    // From a speed that is much too high, the motion might come to rest anywhere, and never end.
    if (plan.excess > kPoorCubic) return plan;
  }
  plan.settled_ns = std::llround(outcome.settled * outcome.slowdown * 1e9);
  plan.knots = slowedDown(knots, grid, outcome.slowdown, begin.ago);
  return plan;
}

}  // namespace stepdriver::motion
