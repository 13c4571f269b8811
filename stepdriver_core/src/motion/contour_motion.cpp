#include "contour_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "contour_grid.h"
#include "contour_speed.h"
#include "give_way.h"
#include "motion/profile.h"

namespace stepdriver::motion {
namespace {

// [s] Knots aren't closer than this, so that rounded times and positions don't change
// accelerations. In such a time an acceleration makes no difference to the position.
constexpr double kShortestPiece = 20e-6;
// What exceeds a limit after so many plans slows the whole motion down; one that begins at a speed
// can't be slowed down.
constexpr int kMostPlans = 6;
constexpr int kMostPlansFromSpeed = 12;
// Of a limit: less is left for the whole motion to be slowed down by.
constexpr double kSmallExcess = 1e-3;
// Lowered limits change the neighbours too: lowering a few of them by a bit more, once most are
// right, makes fewer plans.
constexpr double kLowerBy = 1.002;

// An interval is divided if it isn't at a limit to this part, unless it takes less than a small
// part of its segment's time.
constexpr double kFullUse = 0.92;
constexpr double kMostSquareRatio = 1.5;
constexpr double kSmallPart = 0.005;
// If both ends of an interval are checked, and that lowers the speed by so much, it is divided,
// unless it is too short even for that.
constexpr double kMostLoss = 1.02;
constexpr double kSmallestPart = 1e-4;
// Of a limit: if a cubic exceeds it by so much, both ends of its interval are checked, and it is
// divided if that is still possible.
constexpr double kPoorCubic = 1.01;
// Of the duration of an interval with constant acceleration along it.
constexpr double kMostStretch = 0.1;
constexpr double kMostDeviation = 0.02;  // of the resolution
constexpr int kMostDivisions = 4;
constexpr std::size_t kPartsOfDivided = 2;

// A straight part, from a speed to another one, and what lies between.
struct Trapezoid {
  double ramp_up = 0.0;  // s
  double way_up = 0.0;   // unit
  double cruise = 0.0;   // s
  double way_cruise = 0.0;
  double ramp_down = 0.0;  // s
  double peak = 0.0;       // unit/s

  double duration() const { return ramp_up + cruise + ramp_down; }
};

Trapezoid trapezoidOf(double length, double begin_square, double end_square,
                      const ContourSpeed::Ramp& ramp, double peak_square) {
  Trapezoid made;
  made.peak = std::sqrt(peak_square);
  made.ramp_up = (made.peak - std::sqrt(begin_square)) / ramp.up;
  made.ramp_down = (made.peak - std::sqrt(end_square)) / ramp.down;
  made.way_up = (peak_square - begin_square) / (2.0 * ramp.up);
  const double way_down = (peak_square - end_square) / (2.0 * ramp.down);
  made.way_cruise = std::max(0.0, length - made.way_up - way_down);
  made.cruise = made.way_cruise / made.peak;
  // From a speed that is too high for the ramp, it has to slow down more steeply.
  const double way_left = length - made.way_up;
  if (way_down > way_left) made.ramp_down = 2.0 * way_left / (made.peak + std::sqrt(end_square));
  return made;
}

// The demands of a cubic on the axes, in parts of their limits: the largest of all axes.
struct Demand {
  double acceleration_at_begin = 0.0;
  double acceleration_at_end = 0.0;
  double speed = 0.0;

  double acceleration() const { return std::max(acceleration_at_begin, acceleration_at_end); }
};

// The motion at a planned speed: the durations of the intervals, and its knots. What follows from
// the speeds at both ends of an interval is kept until they change.
class Knots {
 public:
  Knots(const ContourGrid& grid, const std::vector<ContourLimits>& limits)
      : grid_(grid), limits_(limits), axes_(grid.axes()) {
    kept_.reserve(grid.capacity());
    kept_.resize(grid.size());
  }

  /// After ContourGrid::divideEach().
  void regrid(const Division& division) {
    division.spread(kept_);
    for (std::size_t i = 0; i < division.intervals.size(); ++i) {
      for (std::size_t k = 0; k < division.parts; ++k) kept_[division.firstPartOf(i) + k] = {};
    }
  }

  void findDurations(const ContourSpeed& speed) {
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

  void make(const ContourSpeed& speed) {
    findDurations(speed);
    knots_.clear();
    // A straight part may have two more.
    knots_.reserve(2 * grid_.size());
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
  /// Whether settle() has been called since the speeds of an interval changed.
  bool isSettled(std::size_t interval) const { return kept_[interval].settled; }
  void settle(std::size_t interval) { kept_[interval].settled = true; }
  /// Of the cubic of an interval that isn't straight.
  const Demand& demandOf(std::size_t interval) {
    Kept& kept = kept_[interval];
    if (!kept.demand) {
      kept.demand = cubicDemand(
          kept.duration,
          [&](std::size_t j) -> Joint {
            return {grid_.position(interval)[j], grid_.firstAtBegin(interval)[j] * kept.begin};
          },
          [&](std::size_t j) -> Joint {
            return {grid_.position(interval + 1)[j], grid_.firstAtEnd(interval)[j] * kept.end};
          });
    }
    return *kept.demand;
  }

  std::size_t size() const { return knots_.size(); }
  double time(std::size_t knot) const { return knots_[knot].time; }
  std::size_t interval(std::size_t knot) const { return knots_[knot].interval; }
  double position(std::size_t knot, std::size_t axis) const {
    const Knot& of = knots_[knot];
    return of.place == kNoPlace
               ? grid_.position(of.interval)[axis] + grid_.firstAtBegin(of.interval)[axis] * of.way
               : grid_.position(of.place)[axis];
  }
  double velocity(std::size_t knot, std::size_t axis) const {
    const Knot& of = knots_[knot];
    const bool at_end = of.place != kNoPlace && of.place > 0;
    const double* direction =
        at_end ? grid_.firstAtEnd(of.interval) : grid_.firstAtBegin(of.interval);
    return direction[axis] * of.speed;
  }
  double parameter(std::size_t knot) const { return knots_[knot].parameter; }
  double speed(std::size_t knot) const { return knots_[knot].speed; }
  /// On the way from the knot before it.
  bool isStraight(std::size_t knot) const {
    const std::size_t last = interval(knot);
    const std::size_t first = interval(knot - 1);
    const bool whole = first + 1 == last && parameter(knot - 1) == grid_[first].to;
    return grid_[last].straight && (first == last || whole);
  }
  /// [s] Of the last knot that isn't after a place.
  double timeAt(std::size_t place) const {
    const auto later = std::lower_bound(
        knots_.begin() + 1, knots_.end(), place,
        [](const Knot& knot, std::size_t wanted) { return knot.interval < wanted; });
    return (later - 1)->time;
  }

  /// Of the cubic that ends at a knot.
  Demand demandBefore(std::size_t knot) {
    const std::size_t place = knots_[knot].place;
    const bool whole = place != kNoPlace && knots_[knot - 1].place + 1 == place;
    if (whole && !grid_[place - 1].straight) return demandOf(place - 1);
    return cubicDemand(
        time(knot) - time(knot - 1),
        [&](std::size_t j) -> Joint {
          return {position(knot - 1, j), velocity(knot - 1, j)};
        },
        [&](std::size_t j) -> Joint {
          return {position(knot, j), velocity(knot, j)};
        });
  }

 private:
  static constexpr std::size_t kNoPlace = std::numeric_limits<std::size_t>::max();

  // Of an interval.
  struct Kept {
    double begin_square = -1.0;  // unit^2/s^2
    double end_square = -1.0;
    double begin = 0.0;  // unit/s
    double end = 0.0;
    double duration = 0.0;  // s
    std::optional<Demand> demand = {};
    bool settled = false;
  };
  struct Knot {
    double time;
    std::size_t interval;  // of the grid, which ends at the knot or contains it
    std::size_t place;     // or kNoPlace, within a straight part
    double way;            // unit, from the begin of the straight part
    double parameter;
    double speed;
  };
  struct Joint {
    double position;
    double velocity;
  };

  // @param from, to return the joint of an axis at the begin and at the end.
  template <typename From, typename To>
  Demand cubicDemand(double duration, const From& from, const To& to) const {
    Demand demand;
    const double rate = 1.0 / duration;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const auto [p0, v0] = from(j);
      const auto [p1, v1] = to(j);
      const double mean = (p1 - p0) * rate;
      const double begin = (6.0 * mean - 4.0 * v0 - 2.0 * v1) * rate;
      const double end = (2.0 * v0 + 4.0 * v1 - 6.0 * mean) * rate;
      const int direction = directionOf(v0, v1);
      const auto part = [&](double a) {
        return std::abs(a) / accelerationTowards(limits_[j], direction, a > 0.0 ? 1 : -1);
      };
      demand.acceleration_at_begin = std::max(demand.acceleration_at_begin, part(begin));
      demand.acceleration_at_end = std::max(demand.acceleration_at_end, part(end));
      double speed = std::max(std::abs(v0), std::abs(v1));
      if (begin * end < 0.0) {
        const double turn = begin / (begin - end);  // of the acceleration, in parts of the duration
        speed = std::max(speed, std::abs(v0 + begin * turn * duration / 2.0));
      }
      demand.speed = std::max(demand.speed, speed / limits_[j].speed);
    }
    return demand;
  }

  // [s] The duration closest to T = 2 length/(begin + end), that of a constant s'', for which the
  // accelerations at both ends of the cubic keep to their limits. For T (1 + e), they are
  // a - 6 e way/T^2 at the begin and b + 6 e way/T^2 at the end, but for e^2. If there is none, the
  // excess is the same at both limits.
  double durationOf(std::size_t interval, double begin, double end) const {
    const double even = 2.0 * grid_[interval].length / (begin + end);
    const double rate = 1.0 / even;
    double least = -kMostStretch;
    double most = kMostStretch;
    for (std::size_t j = 0; j < axes_; ++j) {
      const double way = grid_.position(interval + 1)[j] - grid_.position(interval)[j];
      const double v0 = grid_.firstAtBegin(interval)[j] * begin;
      const double v1 = grid_.firstAtEnd(interval)[j] * end;
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

  Trapezoid trapezoid(std::size_t interval, const ContourSpeed& speed) const {
    return trapezoidOf(grid_[interval].length, speed.square(interval), speed.square(interval + 1),
                       speed.ramp(interval), speed.peakSquare(interval));
  }

  void appendStraight(std::size_t interval, const ContourSpeed& speed, double time) {
    const Trapezoid made = trapezoid(interval, speed);
    appendOnLine(interval, time + made.ramp_up, made.way_up, made.peak);
    appendOnLine(interval, time + made.ramp_up + made.cruise, made.way_up + made.way_cruise,
                 made.peak);
  }

  void appendOnLine(std::size_t interval, double time, double way, double speed) {
    if (!makeRoom(time, false)) return;
    const ContourGrid::Interval& of = grid_[interval];
    const double part = std::min(1.0, way / of.length);
    knots_.push_back({time, interval, kNoPlace, way, of.from + part * (of.to - of.from), speed});
  }

  void appendPlace(std::size_t place, double time, double speed, std::size_t interval) {
    if (!makeRoom(time, speed == 0.0)) return;
    const double parameter = place == 0 ? grid_[0].from : grid_[interval].to;
    knots_.push_back({time, interval, place, 0.0, parameter, speed});
  }

  // Of two knots that are too close to each other, one at rest stays, or else the earlier one.
  bool makeRoom(double time, bool rests) {
    if (knots_.empty() || time - knots_.back().time >= kShortestPiece) return true;
    if (!rests || knots_.back().speed == 0.0) return rests;
    knots_.pop_back();
    return true;
  }

  const ContourGrid& grid_;
  const std::vector<ContourLimits>& limits_;
  std::size_t axes_;
  std::vector<Kept> kept_;  // of each interval
  std::vector<Knot> knots_;
};

// By what factor limits are exceeded; 1 if they aren't.
struct Excess {
  double acceleration = 1.0;
  double speed = 1.0;
};

// Whether an interval is so long that the motion isn't close to any limit at one of its ends, or
// that the highest speed differs much between them: a motion that is as fast as possible is at one
// of its limits everywhere.
bool wastesTime(const ContourSpeed& speed, std::size_t interval, const Demand& demand) {
  const double begin = speed.square(interval);
  const double end = speed.square(interval + 1);
  const double begin_use = begin / speed.capAtBegin(interval);
  const double end_use = end / speed.capAtEnd(interval);
  if (std::min(begin_use, end_use) > kFullUse)
    return std::max(begin, end) > kMostSquareRatio * std::min(begin, end);
  return std::min(std::max(demand.acceleration_at_begin, begin_use),
                  std::max(demand.acceleration_at_end, end_use)) < kFullUse;
}

// How far the cubic of an interval may be from the contour [unit] if its curvature changes evenly.
// Let L be its length, b the angle by which it turns, and r = (v1 - v0)/(v1 + v0) for the speeds at
// its ends. The fourth derivative of q(s(t)) with constant s'' and curvature is 3 q'' s''^2 +
// 6 q''' s'' s'^2 + q'''' s'^4, and the cubic deviates by T^4/384 of that.
double evenDeviation(const ContourGrid& grid, std::size_t interval, double begin, double end) {
  double square = 0.0;
  for (std::size_t j = 0; j < grid.axes(); ++j) {
    const double change = grid.firstAtEnd(interval)[j] - grid.firstAtBegin(interval)[j];
    square += change * change;
  }
  const double r = std::abs(end - begin) / (end + begin);
  const double b = std::sqrt(square);
  return grid[interval].length * b * (r * r + b * r + b * b / 12.0) / 32.0;
}

// How far the middle of that cubic is from the contour [unit], at a right angle to the contour's
// direction in the middle of the interval.
double middleDeviation(const ContourGrid& grid, std::size_t interval, double begin, double end,
                       double duration) {
  const ContourPoint& middle = grid.evaluateMiddle(interval);
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

// Whether an interval wastes time, unless it takes only a small part of its segment's, or deviates.
bool isLong(std::size_t interval, double part, double deviation, const ContourGrid& grid,
            ContourSpeed& speed, Knots& knots) {
  if (part >= kSmallestPart && speed.lossOfBothEnds(interval) > kMostLoss) return true;
  if (part >= kSmallPart && wastesTime(speed, interval, knots.demandOf(interval))) return true;
  const double begin = knots.beginSpeed(interval);
  const double end = knots.endSpeed(interval);
  return evenDeviation(grid, interval, begin, end) > deviation ||
         middleDeviation(grid, interval, begin, end, knots.duration(interval)) > deviation;
}

// Divides the intervals that are too long, and those whose cubics are poor.
bool divideLong(double deviation, ContourGrid& grid, ContourSpeed& speed, Knots& knots) {
  std::vector<bool> divided(grid.size(), false);
  std::vector<double> times(grid[grid.size() - 1].segment + 1, 0.0);  // of the segments
  for (std::size_t i = 0; i < grid.size(); ++i) times[grid[i].segment] += knots.duration(i);
  bool any = false;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    giveWayAt(i);
    if (grid[i].straight || knots.isSettled(i)) continue;
    const bool poor = knots.demandOf(i).acceleration() > kPoorCubic;
    if (poor) speed.checkBothEnds(i);
    const double part = knots.duration(i) / times[grid[i].segment];
    if (poor || isLong(i, part, deviation, grid, speed, knots)) {
      divided[i] = any = true;
    } else {
      knots.settle(i);
    }
  }
  if (!any) return false;
  const Division division = grid.divideEach(divided, kPartsOfDivided);
  speed.regrid(division);
  knots.regrid(division);
  return true;
}

// Lowers the limits of the intervals of the cubics that exceed them, or has both ends of them
// checked; returns the largest excess.
Excess lowerLimits(double by_more, double poor, const ContourGrid& grid, ContourSpeed& speed,
                   Knots& knots) {
  Excess worst;
  for (std::size_t i = 1; i < knots.size(); ++i) {
    const Demand demand = knots.demandBefore(i);
    const Excess excess{std::max(1.0, demand.acceleration()), std::max(1.0, demand.speed)};
    worst.acceleration = std::max(worst.acceleration, excess.acceleration);
    worst.speed = std::max(worst.speed, excess.speed);
    if (excess.acceleration == 1.0 && excess.speed == 1.0) continue;
    const std::size_t last = knots.interval(i);
    const std::size_t first = std::min(knots.interval(i - 1) + (i > 1 ? 1 : 0), last);
    const auto by = [&](double factor) { return factor > 1.0 ? factor * by_more : 1.0; };
    for (std::size_t k = first; k <= last; ++k) {
      const bool checks = excess.acceleration > poor && !grid[k].straight && speed.checkBothEnds(k);
      speed.lower(k, checks ? 1.0 : by(excess.acceleration), by(excess.speed));
    }
  }
  return worst;
}

// The same motion, slower by a factor, at times of whole nanoseconds.
std::vector<ContourKnot> slowedDown(const Knots& knots, const Contour& contour,
                                    const ContourGrid& grid, double factor, double ago) {
  const double last = knots.time(knots.size() - 1) * factor;
  if (!(last < Profile::kLongest)) {
    throw std::range_error("the motion along the path would take longer than 4e9 s");
  }
  std::vector<ContourKnot> made;
  made.reserve(knots.size());
  for (std::size_t i = 0; i < knots.size(); ++i) {
    const double time = knots.time(i) * factor - ago;
    ContourKnot& knot = made.emplace_back();
    knot.time_ns = std::llround(time * 1e9);
    const double later = static_cast<double>(knot.time_ns) * 1e-9 - time;
    knot.segment = grid[knots.interval(i)].segment;
    knot.parameter = knots.parameter(i);
    knot.speed = knots.speed(i) / factor;
    knot.may_begin = knot.parameter >= contour.roundedUntil(knot.segment);
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

// The largest part of a limit that the motion uses if that is more than 1, and the factor by which
// it has to be slowed down as a whole for that.
struct Outcome {
  double excess = 1.0;
  double slowdown = 1.0;
  double settled = 0.0;  // [s] see ContourPlan, of the motion that isn't slowed down
};

Outcome planKnots(const Contour& contour, const std::vector<ContourLimits>& limits,
                  double begin_speed, ContourGrid& grid, Knots& knots) {
  ContourSpeed speed(contour, grid, limits, begin_speed * begin_speed, CheckedAcceleration::kMean);
  for (int i = 0; i < kMostDivisions; ++i) {
    speed.plan();
    knots.findDurations(speed);
    if (!divideLong(kMostDeviation * contour.resolution(), grid, speed, knots)) break;
  }
  // From a speed, what still exceeds the limits isn't slowed down afterwards.
  const bool from_speed = begin_speed > 0.0;
  const int most_plans = from_speed ? kMostPlansFromSpeed : kMostPlans;
  for (int plans = 1;; ++plans) {
    speed.plan();
    knots.make(speed);
    const bool first = plans == 1;
    const double poor = from_speed && !first ? 1.0 : kPoorCubic;
    const Excess excess = lowerLimits(first ? 1.0 : kLowerBy, poor, grid, speed, knots);
    Outcome outcome{std::max(excess.acceleration, excess.speed)};
    if (outcome.excess > 1.0 + kSmallExcess && plans < most_plans) continue;
    if (!from_speed) outcome.slowdown = std::max(std::sqrt(excess.acceleration), excess.speed);
    outcome.settled = knots.timeAt(speed.settledUntil());
    return outcome;
  }
}

}  // namespace

ContourPlan planContour(const Contour& contour, const std::vector<ContourLimits>& limits,
                        const ContourBegin& begin) {
  ContourGrid grid(contour, begin.parameter, ContourGrid::kForAcceleration);
  Knots knots(grid, limits);
  const Outcome outcome = planKnots(contour, limits, begin.speed, grid, knots);
  ContourPlan plan;
  if (begin.speed > 0.0) plan.excess = outcome.excess;
  plan.settled_ns = std::llround(outcome.settled * outcome.slowdown * 1e9);
  plan.knots = slowedDown(knots, contour, grid, outcome.slowdown, begin.ago);
  return plan;
}

}  // namespace stepdriver::motion
