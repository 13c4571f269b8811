#include "jerk_limited.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "corner_look_ahead.h"
#include "geometry/path_grid.h"
#include "give_way.h"
#include "jerk_limited_knots.h"
#include "knot_quintic.h"
#include "limit_usage.h"
#include "moving_average.h"
#include "optimal_motion.h"
#include "path_speed.h"
#include "profile/errors.h"
#include "profile/profile.h"
#include "reachability.h"

namespace stepdriver::motion {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
// Rounded times and numbers change a jerk or an acceleration by no more than these parts of its
// limit. The times of both ends of a quintic of the duration h are rounded by e each, which changes
// its jerk j by 9 j e/h. Numbers that are rounded by r change it by 60 r/h^3, and its acceleration
// by 5.8 r/h^2, if they are positions, and by 24 r/h^2 and 4 r/h if they are speeds. Knots are
// never closer than that allows.
constexpr double kMostRoundingOfTimes = 4.5e-5;
constexpr double kLargestRounding = 1e-3;
constexpr int kMostPlansOfAverage = 12;  // Each time of the average gets at most so many plans.
constexpr double kNoExcess = 1e-3;
// A shorter part of a segment counts as nothing.
constexpr double kNoPart = 1e-9;
// Rounding changes the square of a speed by no more than this part of it.
constexpr double kSquareRounding = 1e-9;
constexpr double kNoDifference = 1e-6;
// What exceeds a limit is lowered by this part more than it exceeds it, and by more with each plan.
constexpr double kLowerMoreBy = 2e-3;
constexpr double kLowerMostMoreBy = 0.1;
constexpr double kShorterBy = 0.7;         // factor between two times of the average
constexpr double kShortestAverage = 1e-3;  // [s]
// Parts of the path's resolution.
constexpr double kMostQuinticDeviation = 0.05;
constexpr double kNearFoot = 1e-3;
constexpr int kMostDivisionRounds = 4;
constexpr std::size_t kPartsOfDivision = 4;
constexpr int kMostPlansOnPath = 40;
// Most motions keep to their limits after one tightening. One along 1000 random lines, which has
// other knots after each of them, needs eight.
constexpr int kMostTightenings = 8;
constexpr double kSlowerBy = 1.5;  // factor between two durations if knots are too close
constexpr int kLooks = 8;          // parts of a quintic at whose ends its deviation is looked at

// The motion between two stops, or from a speed to a stop.
class JerkLimitedSection {
 public:
  JerkLimitedSection(const Path& path, const std::vector<TimingLimits>& limits,
                     const TimingStart& begin)
      : path_(path), limits_(limits), begin_(begin), grid_(path, begin.parameter) {
    findCaps();
  }

  struct Plan {
    JerkLimitedKnots knots;
    std::vector<std::size_t> segments;  // each knot's segment
    std::vector<bool> straight;  // The way to the next knot is straight, at constant acceleration.
    double time = 0.0;           // [s] the time of the average
    double settled = 0.0;        // [s]
    double slowdown = 1.0;
    // By which factor a motion that begins at a speed exceeds a limit: it can't be slowed down.
    double excess = 1.0;
    bool possible() const { return excess <= 1.0 + kNoExcess; }
    double duration() const { return knots.back().time * slowdown; }
    bool isBetterThan(const Plan& other) const {
      if (!possible() || !other.possible()) return excess < other.excess;
      return duration() < other.duration();
    }
  };

  /// Whether a stop at the corner at the end of a segment may be faster: whether the corner limits
  /// the speed to less than half of the peak v that the segments at both sides allow from rest to
  /// rest. With the highest jerk j, half of that way is v sqrt(v/j). If the corner is passed at
  /// v/2, it takes 2.72 sqrt(v/j): 2 sqrt(v/2j) up to that speed and the rest of the way at it.
  /// From rest to rest it takes 3.17 sqrt(v/j).
  bool mayStopAt(std::size_t corner) const {
    double length = 0.0;
    double jerk = 0.0;
    double fastest = 0.0;
    double slowest = kUnlimited;
    for (std::size_t i = grid_.firstFrom({corner, 0.0}); i < grid_.size(); ++i) {
      const PathGrid::Interval& interval = grid_[i];
      if (interval.segment > corner + 1) break;
      const bool before = interval.segment == corner;
      const bool rounded = before ? interval.to > path_.roundedFrom(corner)
                                  : interval.from < path_.roundedUntil(corner + 1);
      length += interval.length;
      jerk = std::max(jerk, highestJerk(grid_, i, limits_, 0.0));
      fastest = std::max(fastest, caps_[i].value);
      if (rounded) slowest = std::min(slowest, caps_[i].value);
    }
    return 2.0 * slowest < std::min(fastest, std::cbrt(length * length * jerk / 4.0));
  }

  /// The fastest of some averages.
  Plan average() {
    return onThePath([this] { return bestOfTimes(); });
  }

  /// What continues another motion, or will be continued, begins at the knots of an average.
  bool mustAverage() const { return moves() || path_.continues(); }

  /// The optimum that is found from an average, or that average if it is faster.
  Plan optimum(const Plan& average) {
    return onThePath([&] {
      std::optional<Plan> optimum = optimumFrom(average);
      return optimum && optimum->isBetterThan(average) ? *std::move(optimum) : average;
    });
  }

  /// The motion from rest to rest along lines that passes each corner between them at a constant
  /// speed [unit/s] above 0.
  Plan throughCorners(const std::vector<double>& speeds) {
    return onThePath([&] {
      std::optional<Plan> plan = planThroughCorners(speeds);
      return plan ? *std::move(plan) : bestOfTimes();
    });
  }

  /// @name A section of lines, for cornerSpeeds()
  /// @{
  LineBetweenCorners lineOf(std::size_t segment) const {
    PathPoint from;
    PathPoint to;
    path_.evaluateGiven(segment, 0.0, from);
    path_.evaluateGiven(segment, 1.0, to);
    LineBetweenCorners line;
    std::vector<double>& way = to.position;
    double square = 0.0;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      way[j] -= from.position[j];
      square += way[j] * way[j];
    }
    line.length = std::sqrt(square);
    line.in_first = path_.roundedUntil(segment) * line.length;
    line.in_last = (1.0 - path_.roundedFrom(segment)) * line.length;
    const std::vector<bool>& measured = path_.measured(segment);
    double rate = 0.0;  // the square of the measured axes' rate
    line.limits = {kUnlimited, kUnlimited, kUnlimited, kUnlimited};
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const double part = std::abs(way[j]) / line.length;
      if (!(part > 0.0)) continue;
      if (measured.empty() || measured[j]) rate += part * part;
      const TimingLimits& of = limits_[j];
      const double ramp = std::max(of.acceleration, of.deceleration) / kShortestAverage;
      line.limits.speed = std::min(line.limits.speed, of.speed / part);
      line.limits.acceleration = std::min(line.limits.acceleration, of.acceleration / part);
      line.limits.deceleration = std::min(line.limits.deceleration, of.deceleration / part);
      line.limits.jerk = std::min(line.limits.jerk, std::min(of.jerk, ramp) / part);
    }
    if (rate > 0.0) {
      line.limits.speed = std::min(line.limits.speed, path_.speed(segment) / std::sqrt(rate));
    }
    return line;
  }

  // The speed is lowered by what the quintics along the corner exceed at it.
  RoundedCorner cornerAfter(std::size_t segment) const {
    RoundedCorner corner;
    corner.speed = kUnlimited;
    const std::size_t begin = grid_.firstFrom({segment, path_.roundedFrom(segment)});
    std::size_t end = begin;
    for (; end < grid_.size() && cornerOf(end) == segment; ++end) {
      corner.length += grid_[end].length;
      corner.speed = std::min(corner.speed, caps_[end].value);
    }
    LimitUsage usage;
    for (std::size_t i = begin; i < end; ++i) {
      const double v = corner.speed;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        usage.include(usageOf(
            {grid_.position(i)[j], grid_.firstAtBegin(i)[j] * v, grid_.secondAtBegin(i)[j] * v * v},
            {grid_.position(i + 1)[j], grid_.firstAtEnd(i)[j] * v, grid_.secondAtEnd(i)[j] * v * v},
            grid_[i].length / v, limits_[j]));
      }
    }
    corner.speed = corner.length > 0.0 ? corner.speed / usage.slowdown() : 0.0;
    return corner;
  }
  /// @}

 private:
  static constexpr std::size_t kNoCorner = std::numeric_limits<std::size_t>::max();

  // The segment at whose end is the corner to which an interval belongs.
  std::size_t cornerOf(std::size_t interval) const {
    const PathGrid::Interval& of = grid_[interval];
    const double middle = (of.from + of.to) / 2.0;
    if (middle > path_.roundedFrom(of.segment)) return of.segment;
    return middle < path_.roundedUntil(of.segment) ? of.segment - 1 : kNoCorner;
  }

  // Divides intervals in which quintics would deviate from the path. If they deviate because knots
  // would be too close to each other, the motion is slowed down.
  template <typename MakePlan>
  Plan onThePath(const MakePlan& make) {
    int divisions = 0;
    for (int i = 0;; ++i) {
      Plan plan = make();
      if (!plan.possible()) return plan;
      std::vector<bool> deviates(grid_.size(), false);
      if (divisions < kMostDivisionRounds && findDeviations(plan.knots, deviates)) {
        grid_.divideEach(deviates, kPartsOfDivision);
        findCaps();
        ++divisions;
      } else if (i < kMostPlansOnPath && cutsCorners(plan.knots)) {
        if (moves()) return impossible(limits_.size());
        stretch_ *= kSlowerBy;
      } else {
        return plan;
      }
    }
  }

  // The same motion, slower by stretch_. What is averaged keeps its accelerations, see lower().
  void stretch(std::vector<AveragedPart>& parts) const {
    if (stretch_ == 1.0) return;
    for (AveragedPart& part : parts) {
      part.time *= stretch_;
      part.speed /= stretch_;
      part.acceleration /= stretch_ * stretch_;
      part.jerk /= stretch_ * stretch_ * stretch_;
    }
  }

  // The result is empty if a line is too short for the change of the speed by rounding.
  std::optional<Plan> planThroughCorners(const std::vector<double>& speeds) const {
    std::vector<AveragedPart> parts;
    AveragedPart at;
    const auto run = [&](double duration, double jerk) {
      at.jerk = jerk;
      parts.push_back(at);
      at.time += duration;
      at.distance +=
          duration * (at.speed + duration * (at.acceleration / 2.0 + duration * jerk / 6.0));
      at.speed += duration * (at.acceleration + duration * jerk / 2.0);
      at.acceleration += duration * jerk;
    };
    double passed = 0.0;
    std::size_t i = 0;
    const auto pass_intervals = [&](std::size_t corner, std::size_t segment) {
      const double begin = passed;
      for (; i < grid_.size() && cornerOf(i) == corner; ++i) {
        if (corner == kNoCorner && grid_[i].segment != segment) break;
        passed += grid_[i].length;
      }
      return passed - begin;
    };
    for (std::size_t segment = 0; segment <= speeds.size(); ++segment) {
      const double before = segment == 0 ? 0.0 : speeds[segment - 1];
      const double after = segment == speeds.size() ? 0.0 : speeds[segment];
      const double line = pass_intervals(kNoCorner, segment);
      if (line > 0.0) {
        const auto phases = planLine(line, before, after, lineOf(segment).limits);
        if (!phases) return std::nullopt;
        for (const LinePhase& phase : *phases) run(phase.duration, phase.jerk);
      } else if (before != after) {
        return std::nullopt;
      }
      at.distance = passed;
      at.speed = after;
      at.acceleration = 0.0;
      if (segment == speeds.size()) break;
      run(pass_intervals(segment, segment) / after, 0.0);
      at.distance = passed;
    }
    if (i < grid_.size()) return std::nullopt;
    at.jerk = 0.0;
    parts.push_back(at);
    return planParts(std::move(parts));
  }

  Plan planParts(std::vector<AveragedPart> parts) const {
    stretch(parts);
    Plan plan = planOf(grid_, parts, kShortestAverage, parts.back().time);
    LimitUsage worst;
    for (std::size_t i = 0; i < plan.knots.size(); ++i) {
      plan.straight.push_back(false);
      if (i > 0) worst.include(usageBefore(plan.knots, i, grid_));
    }
    plan.slowdown = worst.slowdown();
    return plan;
  }

  // The optimum, found from another motion from rest to rest. The result is empty if that is too
  // short.
  //
  // The limits hold at the ends of its pieces. What a quintic exceeds in between tightens them on
  // its way.
  std::optional<Plan> optimumFrom(const Plan& given) const {
    OptimalMotion motion(grid_, limits_, squares_, middles_, given.knots, given.time);
    std::optional<Plan> best;
    for (int round = 0; round <= kMostTightenings && motion.solve(); ++round) {
      Plan plan = planParts(motion.parts());
      for (std::size_t i = 1; i < plan.knots.size(); ++i) {
        const LimitUsage usage = usageBefore(plan.knots, i, grid_);
        if (usage.most() < 1.0 + kNoExcess) continue;
        const double from = plan.knots[i - 1].distance;
        const double to = plan.knots[i].distance;
        const double margin = kMargin * (to - from);
        motion.tighten(from + margin, to - margin, usage);
      }
      const bool done = plan.slowdown < 1.0 + kNoExcess;
      if (!best || plan.isBetterThan(*best)) best = std::move(plan);
      if (done) break;
    }
    return best;
  }

  // The knots of a motion, and their segments.
  // @param time, average see makeKnots() and closestKnots() [s].
  Plan planOf(const PathGrid& grid, const std::vector<AveragedPart>& parts, double time,
              double average) const {
    const std::vector<double> closest = closestKnots(grid, parts, average);
    Plan plan{makeKnots(grid, limits_, parts, time, closest, path_.resolution()), {}, {}};
    for (std::size_t i = 0; i < plan.knots.size(); ++i) {
      plan.segments.push_back(grid[plan.knots[i].interval].segment);
    }
    return plan;
  }

  // The first interval on the way from a knot to the next one.
  static std::size_t intervalAfter(const JerkLimitedKnots& knots, std::size_t index,
                                   const PathGrid& grid) {
    const JerkLimitedKnots::Knot& from = knots[index];
    // A knot at the end of an interval belongs to it.
    const bool whole = from.parameter == grid[from.interval].to;
    return whole ? std::min(from.interval + 1, knots[index + 1].interval) : from.interval;
  }

  // The usage of the limits by the quintic that ends at a knot.
  LimitUsage usageBefore(const JerkLimitedKnots& knots, std::size_t index,
                         const PathGrid& grid) const {
    LimitUsage usage;
    PathSpeed path_speed(path_, grid[intervalAfter(knots, index - 1, grid)].segment,
                         grid[knots[index].interval].segment);
    const double duration = knots[index].time - knots[index - 1].time;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const JerkLimitedKnots::State& begin = knots.state(index - 1, j);
      const JerkLimitedKnots::State& end = knots.state(index, j);
      usage.include(usageOf(begin, end, duration, limits_[j]));
      if (!path_speed.isLimited()) continue;
      const KnotQuintic curve(begin, end, duration);
      path_speed.include(j, [&](double u) { return curve.velocity(u); });
    }
    if (path_speed.isLimited()) usage.speed = std::max(usage.speed, path_speed.usage());
    return usage;
  }

  // What has been lowered because a quintic exceeded a limit.
  struct Lowered {
    std::vector<CeilingSpan> speeds;
    std::vector<CeilingSpan> accelerations;
    // The first places are many, and near to their limits. The last ones move with each plan.
    double more = kLowerMoreBy;
  };

  // What the average contains when it begins at a speed: a motion at constant acceleration for the
  // time T that has this mean place, speed and acceleration.
  struct History {
    double begin = 0.0;  // [unit]
    double begin_speed = 0.0;
    double end = 0.0;
    double end_speed = 0.0;
  };
  History historyOver(double time) const {
    double change = begin_.acceleration * time;
    if (std::abs(change) < kNoDifference * begin_.speed) change = 0.0;
    const double end = (begin_.speed + change / 6.0) * time / 2.0;
    return {end - begin_.speed * time, begin_.speed - change / 2.0, end,
            begin_.speed + change / 2.0};
  }
  bool moves() const { return begin_.speed > 0.0; }
  static Plan impossible(std::size_t axes) {
    Plan plan{JerkLimitedKnots(axes), {}, {}};
    plan.excess = kUnlimited;
    return plan;
  }

  void findCaps() {
    const Reachability speed(path_, grid_, limits_);
    const std::size_t axes = limits_.size();
    caps_.clear();
    squares_.clear();
    middles_.assign(grid_.size() * axes, 0.0);
    PathPoint middle;
    double distance = 0.0;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      const double length = grid_[i].length;
      if (!grid_[i].straight) {
        grid_.evaluateAt(i, length / 2.0, middle);
        std::copy(middle.second.begin(), middle.second.end(), &middles_[i * axes]);
      }
      squares_.push_back({speed.capAtBegin(i), speed.capAtEnd(i)});
      caps_.push_back({distance, distance + length, capOf(i)});
      distance += length;
    }
  }

  bool moves(std::size_t axis) const {
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      if (std::abs(grid_.firstAtBegin(i)[axis]) > kNoDifference) return true;
    }
    return false;
  }

  // [s] The least time between two knots in each interval of a grid, see kLargestRounding. An axis
  // that stands still in an interval isn't rounded there.
  // @param time the time of the average [s].
  std::vector<double> closestKnots(const PathGrid& grid, const std::vector<AveragedPart>& parts,
                                   double time) const {
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    const double duration = parts.back().time;
    double speed = 0.0;
    for (const AveragedPart& part : parts) speed = std::max(speed, part.speed);
    const double of_times =
        9.0 * std::max(0.5e-9, kEpsilon * (begin_.before + duration)) / kMostRoundingOfTimes;
    // Along the path. The speed is a difference of places at times that are rounded.
    const double speed_rounding = kEpsilon * duration * speed / time;
    const double sums =
        kEpsilon * std::sqrt(static_cast<double>(parts.size())) * parts.back().distance;
    std::vector<double> closest(grid.size(), of_times);
    for (std::size_t i = 0; i < grid.size(); ++i) {
      double cube = 0.0;
      double square = 0.0;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        const double begin = grid.position(i)[j];
        const double end = grid.position(i + 1)[j];
        const double rate =
            std::max(std::abs(grid.firstAtBegin(i)[j]), std::abs(grid.firstAtEnd(i)[j]));
        if (begin == end && rate == 0.0) continue;
        const double rounding = kEpsilon * std::max(std::abs(begin), std::abs(end)) + rate * sums;
        const double of_speed = rate * speed_rounding;
        const double jerk = kLargestRounding * limits_[j].jerk;
        const double acceleration =
            kLargestRounding * std::min(limits_[j].acceleration, limits_[j].deceleration);
        cube = std::max(cube, 60.0 * rounding / jerk);
        square = std::max({square, 24.0 * of_speed / jerk, 5.8 * rounding / acceleration});
        closest[i] = std::max(closest[i], 4.0 * of_speed / acceleration);
      }
      if (square > closest[i] * closest[i]) closest[i] = std::sqrt(square);
      if (cube > closest[i] * closest[i] * closest[i]) closest[i] = std::cbrt(cube);
    }
    return closest;
  }

  // How far the middle of the quintic that ends at a knot is from an interval, at a right angle.
  double deviationOf(const JerkLimitedKnots& knots, std::size_t index, std::size_t interval,
                     double distance, PathPoint& point) const {
    const double h = knots[index].time - knots[index - 1].time;
    const PathGrid::Interval& of = grid_[interval];
    const double part = (distance - caps_[interval].from) / of.length;
    double parameter = of.from + std::clamp(part, 0.0, 1.0) * (of.to - of.from);
    double square = 0.0;
    constexpr int kProjections = 4;
    for (int i = 0; i < kProjections; ++i) {
      path_.evaluate(of.segment, parameter, point);
      double along = 0.0;
      // All three are squares.
      double rate = 0.0;
      double turn = 0.0;
      square = 0.0;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        const JerkLimitedKnots::State& begin = knots.state(index - 1, j);
        const JerkLimitedKnots::State& end = knots.state(index, j);
        const double off = (begin.position + end.position) / 2.0 +
                           h * (5.0 / 32.0 * (begin.velocity - end.velocity) +
                                h * (begin.acceleration + end.acceleration) / 64.0) -
                           point.position[j];
        square += off * off;
        along += off * point.first[j];
        rate += point.first[j] * point.first[j];
        turn += point.second[j] * point.second[j];
      }
      square -= along * along / rate;
      const double change = along / rate;  // the change of the parameter
      parameter = std::clamp(parameter + change, of.from, of.to);
      // Nearer to the foot, the path is where its tangent is.
      if (std::sqrt(turn) * change * change < kNearFoot * path_.resolution()) break;
    }
    return std::sqrt(std::max(0.0, square));
  }

  // Whether a quintic leaves the path between two knots because others, which would be too close to
  // each other, were left out between them.
  bool cutsCorners(const JerkLimitedKnots& knots) const {
    std::size_t interval = 0;
    PathPoint point;
    for (std::size_t i = 1; i < knots.size(); ++i) {
      giveWayAt(i);
      const double margin = kNoDifference * (knots[i].distance - knots[i - 1].distance);
      const auto find = [&](double distance) {
        while (interval + 1 < grid_.size() && caps_[interval].to < distance) ++interval;
        return interval;
      };
      const std::size_t first = find(knots[i - 1].distance + margin);
      const std::size_t last = find(knots[i].distance - margin);
      bool straight = true;
      for (std::size_t k = first; k <= last; ++k) straight = straight && grid_[k].straight;
      if (first == last || straight) continue;
      interval = first;
      const double h = knots[i].time - knots[i - 1].time;
      const auto along = [](const JerkLimitedKnots::Knot& knot) -> JerkLimitedKnots::State {
        return {knot.distance, knot.speed, knot.acceleration};
      };
      for (int k = 1; k < kLooks; ++k) {
        const double u = static_cast<double>(k) / kLooks;
        const double distance = KnotQuintic(along(knots[i - 1]), along(knots[i]), h).position(u);
        const std::size_t at = find(distance);
        grid_.evaluateAt(at, distance - caps_[at].from, point);
        double square = 0.0;
        double ahead = 0.0;
        for (std::size_t j = 0; j < limits_.size(); ++j) {
          const double off = KnotQuintic(knots.state(i - 1, j), knots.state(i, j), h).position(u) -
                             point.position[j];
          square += off * off;
          ahead += off * point.first[j];
        }
        const double most = kMostQuinticDeviation * path_.resolution();
        if (square - ahead * ahead > most * most) return true;
      }
      interval = last;
    }
    return false;
  }

  bool findDeviations(const JerkLimitedKnots& knots, std::vector<bool>& deviates) const {
    bool found = false;
    std::size_t interval = 0;
    PathPoint point;
    for (std::size_t i = 1; i < knots.size(); ++i) {
      giveWayAt(i);
      const double middle = (knots[i - 1].distance + knots[i].distance) / 2.0;
      while (interval + 1 < grid_.size() && caps_[interval].to < middle) ++interval;
      if (grid_[interval].straight) continue;
      if (deviationOf(knots, i, interval, middle, point) <
          kMostQuinticDeviation * path_.resolution())
        continue;
      deviates[interval] = found = true;
    }
    return found;
  }

  // The plans with one time of the average: each lowers what the one before exceeded, and takes
  // longer, apart from what a plan is slowed down by as a whole.
  class Rounds {
   public:
    Rounds(const JerkLimitedSection& section, double time)
        : section_(&section), time_(time), best_(section.planOnce(time, lowered_)) {
      see(best_);
    }

    // [s] No later plan takes less.
    double shortest() const { return shortest_; }
    // [s] The duration of the best plan so far.
    double duration() const { return best_.excess < kUnlimited ? best_.duration() : kUnlimited; }
    // Whether a later plan may be better.
    bool isOpen() const { return open_; }
    const Plan& best() const& { return best_; }
    Plan best() && { return std::move(best_); }

    void next() {
      Plan plan = section_->planOnce(time_, lowered_);
      see(plan);
      if (plan.isBetterThan(best_)) best_ = std::move(plan);
    }

   private:
    void see(const Plan& plan) {
      ++plans_;
      const bool planned = plan.excess < kUnlimited;
      const bool done = plan.slowdown <= 1.0 + kNoExcess && plan.possible();
      open_ = planned && !done && plans_ < kMostPlansOfAverage;
      shortest_ = planned ? plan.knots.back().time : kUnlimited;
    }

    const JerkLimitedSection* section_;
    double time_;
    Lowered lowered_;
    Plan best_;
    double shortest_ = 0.0;
    int plans_ = 0;
    bool open_ = true;
  };

  // The longest average that can be of use [s].
  double longestAverage() const {
    double time = 0.0;
    double jerk = kUnlimited;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      if (!moves(j)) continue;
      const double acceleration = std::max(limits_[j].acceleration, limits_[j].deceleration);
      time = std::max(time, acceleration / limits_[j].jerk);
      jerk = std::min(jerk, limits_[j].jerk);
    }
    // On a straight line without other limits, four parts of this duration are the fastest.
    return std::max(kShortestAverage, std::min(time, std::cbrt(caps_.back().to / (2.0 * jerk))));
  }

  // Of all times of the average, the one whose last plan is the shortest gets the next plan, until
  // no other one can become faster than the best plan so far.
  Plan bestOfTimes() const {
    std::vector<Rounds> all;
    const auto begin = [&](double time) {
      all.emplace_back(*this, time);
      return all.back().duration();
    };
    double time = longestAverage();
    double duration = begin(time);
    const auto shorten = [&] { return (time *= kShorterBy) > kShortestAverage; };
    while (shorten()) {
      const double before = std::exchange(duration, begin(time));
      if (duration > before) break;
    }
    if (begin_.average > 0.0) begin(begin_.average);
    for (;;) {
      const auto best = std::min_element(all.begin(), all.end(), [](const auto& a, const auto& b) {
        return a.best().isBetterThan(b.best());
      });
      const auto next = std::min_element(all.begin(), all.end(), [](const auto& a, const auto& b) {
        return (a.isOpen() ? a.shortest() : kUnlimited) < (b.isOpen() ? b.shortest() : kUnlimited);
      });
      const bool possible = best->best().possible();
      if (next->isOpen() && !(possible && next->shortest() >= best->best().duration())) {
        next->next();
      } else if (!possible && shorten()) {
        begin(time);
      } else {
        return std::move(*best).best();
      }
    }
  }

  double capOf(std::size_t interval) const;

  // Makes a plan, and adds what exceeds a limit in it to `lowered`.
  Plan planOnce(double time, Lowered& lowered) const {
    History history;
    if (moves()) {
      history = historyOver(time);
      const bool fits = history.begin_speed > 0.0 &&
                        history.end_speed > kLeastSpeed * begin_.speed &&
                        history.end < caps_.back().to * (1.0 - kMargin);
      if (!fits) return impossible(limits_.size());
    }
    std::vector<CeilingSpan> spans;
    spans.reserve(caps_.size() + lowered.speeds.size());
    const double averaged_until = history.end + history.end_speed * time;
    const auto append = [&](const CeilingSpan& span) {
      const double reach = span.value * time / 2.0;
      spans.push_back({span.from - reach, span.to + reach, span.value});
    };
    for (const CeilingSpan& span : caps_) append(span);
    for (CeilingSpan span : lowered.speeds) {
      // What exceeds a limit near the begin is the change of its speed.
      if (moves() && span.from < averaged_until)
        span.value = std::max(span.value, history.end_speed);
      append(span);
    }
    const Ceiling speeds(std::move(spans));
    const Ceiling accelerations(lowered.accelerations);
    std::vector<double> cuts;
    std::merge(speeds.places().begin(), speeds.places().end(), accelerations.places().begin(),
               accelerations.places().end(), std::back_inserter(cuts));
    if (moves())
      cuts.insert(std::upper_bound(cuts.begin(), cuts.end(), averaged_until), averaged_until);
    const PathGrid grid = grid_.divided(cuts);
    std::optional<PathGrid> rest;
    if (moves()) rest.emplace(grid.after(history.end));
    const PathGrid& ahead = rest ? *rest : grid;
    const double begin_square = history.end_speed * history.end_speed;
    Reachability speed(path_, ahead, limits_, begin_square);
    double begin = history.end;
    for (std::size_t i = 0; i < ahead.size(); ++i) {
      giveWayAt(i);
      const double end = begin + ahead[i].length;
      const double margin = kMargin * ahead[i].length;
      double highest = speeds.lowest(begin + margin, end - margin);
      if (moves() && (begin + end) / 2.0 < averaged_until) {
        highest = nearBegin(highest, history.end_speed);
      }
      speed.restrict(i, highest * highest,
                     std::min(time * highestJerk(ahead, i, limits_, time),
                              accelerations.lowest(begin + margin, end - margin)));
      begin = end;
    }
    speed.plan();
    if (speed.controllable(0) < begin_square * (1.0 - kSquareRounding))
      return impossible(limits_.size());
    std::vector<SpeedPlace> given = placesOf(ahead, speed, history.end);
    const SpeedPlace past{history.begin, history.begin_speed * history.begin_speed};
    if (moves()) given.insert(given.begin(), past);
    std::vector<SpeedPlace> places = flattenPeaks(given, time);
    if (moves() && !keepPast(places, past, {history.end, begin_square})) {
      return impossible(limits_.size());
    }
    std::vector<AveragedPart> parts = movingAverage(places, time, moves());
    stretch(parts);
    Plan plan = planOf(grid, parts, time, time);
    for (std::size_t i = 0; i < plan.knots.size(); ++i) {
      plan.straight.push_back(i + 1 < plan.knots.size() && isEven(plan.knots, i, parts, grid));
    }
    const LimitUsage usage = lower(plan.knots, parts, grid, lowered);
    if (moves()) {
      plan.excess = usage.most();
    } else {
      plan.slowdown = usage.slowdown();
    }
    plan.time = time * stretch_;
    const double settled = settledIn(ahead, history.end, time, speed);
    plan.settled = timeBefore(parts, beforePeak(given, places, settled));
    return plan;
  }

  // Returns whether the motion up to its begin is as it was. If so, the begin becomes the second
  // place.
  static bool keepPast(std::vector<SpeedPlace>& places, const SpeedPlace& past,
                       const SpeedPlace& begin) {
    const double close = kNoDifference * (begin.distance - past.distance);
    const auto next = std::find_if(places.begin() + 1, places.end(), [&](const SpeedPlace& place) {
      return place.distance > begin.distance + close;
    });
    if (next == places.end()) return false;
    const SpeedPlace& before = *(next - 1);
    const double part = (begin.distance - before.distance) / (next->distance - before.distance);
    const double square = before.square + part * (next->square - before.square);
    const auto differs = [](double a, double b) { return std::abs(a - b) > kNoDifference * b; };
    if (differs(places.front().square, past.square) || differs(square, begin.square)) return false;
    places.erase(places.begin() + 1, next);
    places.front() = past;
    places.insert(places.begin() + 1, begin);
    return true;
  }

  // [unit/s] The speed limits near the begin apply to the average, which has kept them so far.
  double nearBegin(double highest, double speed) const {
    if (begin_.acceleration < 0.0) highest = std::min(highest, speed);
    const bool close = highest < speed && speed < kMostOver * highest;
    return close ? speed : highest;
  }

  // Whether the way to the next knot is straight, at constant acceleration.
  static bool isEven(const JerkLimitedKnots& knots, std::size_t index,
                     const std::vector<AveragedPart>& parts, const PathGrid& grid) {
    const JerkLimitedKnots::Knot& from = knots[index];
    const JerkLimitedKnots::Knot& to = knots[index + 1];
    if (!from.even) return false;
    for (std::size_t k = from.part; k < to.part; ++k) {
      if (!parts[k + 1].even || parts[k].jerk != 0.0) return false;
    }
    if (!to.even || parts[from.part].jerk != 0.0) return false;
    for (std::size_t k = intervalAfter(knots, index, grid); k <= to.interval; ++k) {
      if (!grid[k].straight || grid[k].segment != grid[to.interval].segment) return false;
    }
    return true;
  }

  // [unit] The place after which the averaged motion depends on what follows the path, apart
  // from peaks.
  double settledIn(const PathGrid& grid, double begin, double time, Reachability& speed) const {
    const Path::Place open = path_.openFrom();
    double lowest = kUnlimited;  // the lowest speed limit that may rise if the path continues
    double from = kUnlimited;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      const PathGrid::Interval& interval = grid_[i];
      const bool before = interval.segment < open.segment ||
                          (interval.segment == open.segment && interval.to <= open.parameter);
      if (before) continue;
      from = std::min(from, caps_[i].from);
      lowest = std::min(lowest, caps_[i].value);
    }
    if (lowest < kUnlimited) from -= lowest * time / 2.0;
    std::size_t place = 0;
    double distance = begin;
    while (place < grid.size() && distance < from) distance += grid[place++].length;
    const std::size_t until = speed.settledUntil(place);
    for (place = 0, distance = begin; place < until; ++place) distance += grid[place].length;
    return distance;
  }

  // The begin of the last peak before a distance if that has been lowered: if the path
  // continues, it may be higher.
  static double beforePeak(const std::vector<SpeedPlace>& given,
                           const std::vector<SpeedPlace>& flattened, double distance) {
    auto begin =
        std::upper_bound(flattened.begin() + 1, flattened.end() - 1, distance,
                         [](double x, const SpeedPlace& place) { return x < place.distance; });
    --begin;
    while (begin != flattened.begin() && (begin - 1)->square >= begin->square) --begin;
    const double most = begin->square * (1.0 + kNoDifference);
    const bool lowered = std::any_of(given.begin(), given.end(), [&](const SpeedPlace& place) {
      return place.distance >= begin->distance && place.distance <= distance && place.square > most;
    });
    return lowered ? begin->distance : distance;
  }

  // [s] When the given motion comes to a distance.
  static double timeBefore(const std::vector<AveragedPart>& parts, double distance) {
    const auto later =
        std::upper_bound(parts.begin() + 1, parts.end(), distance,
                         [](double x, const AveragedPart& part) { return x < part.front; });
    return (later - 1)->time;
  }

  static std::vector<SpeedPlace> placesOf(const PathGrid& grid, const Reachability& speed,
                                          double begin) {
    std::vector<SpeedPlace> places{{begin, speed.square(0)}};
    places.reserve(3 * grid.size());
    const auto append = [&](double distance, double square) {
      if (distance > places.back().distance) places.push_back({distance, square});
    };
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const double end = begin + grid[i].length;
      if (grid[i].straight) {
        const Reachability::Ramp ramp = speed.ramp(i);
        const double peak = speed.peakSquare(i);
        // Rounding makes a way of its own out of a ramp that hardly rises.
        append(std::min(end, begin + (peak - speed.square(i)) / (2.0 * ramp.up)), peak);
        append(std::min(end, end - (peak - speed.square(i + 1)) / (2.0 * ramp.down)), peak);
      }
      append(end, speed.square(i + 1));
      begin = end;
    }
    return places;
  }

  LimitUsage lower(const JerkLimitedKnots& knots, const std::vector<AveragedPart>& parts,
                   const PathGrid& grid, Lowered& lowered) const {
    double steepest = 0.0;
    for (const AveragedPart& part : parts) {
      steepest = std::max(steepest, std::abs(part.front_acceleration));
    }
    const double more = 1.0 + lowered.more;
    lowered.more = std::min(2.0 * lowered.more, kLowerMostMoreBy);
    LimitUsage worst;
    for (std::size_t i = 1; i < knots.size(); ++i) {
      giveWayAt(i);
      const LimitUsage usage = usageBefore(knots, i, grid);
      worst.include(usage);
      if (usage.most() < 1.0 + kNoDifference) continue;
      const double slowdown = usage.slowdown();
      const double speed = std::max(knots[i - 1].speed, knots[i].speed);
      bool straight = true;
      for (std::size_t k = knots[i - 1].interval; k <= knots[i].interval; ++k) {
        straight = straight && grid[k].straight;
      }
      // At so low a speed, a curve makes no difference.
      if (speed < kSlow * lowestCap(knots[i - 1].distance, knots[i].distance)) straight = true;
      const std::size_t last = std::min(knots[i].part + 1, parts.size() - 1);
      double acceleration = 0.0;
      for (std::size_t k = knots[i - 1].part; k < last; ++k) {
        acceleration = std::max({acceleration, std::abs(parts[k].rear_acceleration),
                                 std::abs(parts[k].front_acceleration)});
      }
      if (!straight || usage.speed > 1.0) {
        lowered.speeds.push_back({knots[i - 1].distance, knots[i].distance,
                                  speed * stretch_ / ((straight ? usage.speed : slowdown) * more)});
      }
      if (acceleration > kNoDifference * steepest) {
        const double by = straight ? std::max(usage.acceleration, usage.jerk) : slowdown * slowdown;
        lowered.accelerations.push_back(
            {parts[knots[i - 1].part].rear, parts[last].front, acceleration / (by * more)});
      }
    }
    return worst;
  }

  // [unit/s] The lowest cap of the intervals between two distances.
  double lowestCap(double from, double to) const {
    const double margin = kMargin * (to - from);
    auto span = std::upper_bound(caps_.begin(), caps_.end(), from + margin,
                                 [](double x, const CeilingSpan& cap) { return x < cap.to; });
    double lowest = kUnlimited;
    for (; span != caps_.end() && span->from < to - margin; ++span) {
      lowest = std::min(lowest, span->value);
    }
    return lowest;
  }

  // Part of an interval that rounding may change.
  static constexpr double kMargin = 1e-9;
  // Part of the highest constant speed along an interval, below which its curve doesn't matter.
  static constexpr double kSlow = 0.2;
  // Part of the speed at the begin. An average that would first slow down below it isn't tried.
  static constexpr double kLeastSpeed = 0.1;
  // The places of another grid, and what was lowered for it, make such a difference to a speed.
  static constexpr double kMostOver = 1.01;

  const Path& path_;
  const std::vector<TimingLimits>& limits_;
  const TimingStart& begin_;
  PathGrid grid_;
  double stretch_ = 1.0;           // by this factor, the motion takes longer than planned
  std::vector<CeilingSpan> caps_;  // each interval's cap of the speed
  // For each interval, the squares of the caps at its ends, and the axes' second derivatives in its
  // middle.
  std::vector<OptimalMotion::Caps> squares_;
  std::vector<double> middles_;
};

// [unit/s] The highest constant speed along an interval.
double JerkLimitedSection::capOf(std::size_t interval) const {
  double cap = std::sqrt(std::min(squares_[interval].begin, squares_[interval].end));
  if (grid_[interval].straight) return cap;
  const double length = grid_[interval].length;
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double begin = grid_.secondAtBegin(interval)[j];
    const double end = grid_.secondAtEnd(interval)[j];
    const double middle = middles_[interval * limits_.size() + j];
    // The slope of the parabola through the three second derivatives.
    const double third = std::max(std::abs(-3.0 * begin + 4.0 * middle - end),
                                  std::abs(begin - 4.0 * middle + 3.0 * end)) /
                         length;
    const double second = std::max({std::abs(begin), std::abs(middle), std::abs(end)});
    const double acceleration = std::min(limits_[j].acceleration, limits_[j].deceleration);
    if (second > 0.0) cap = std::min(cap, std::sqrt(acceleration / second));
    if (third > 0.0) cap = std::min(cap, std::cbrt(limits_[j].jerk / third));
  }
  return cap;
}

// @param before [s] See TimingStart::before.
TimingStart atRest(double before) {
  TimingStart begin;
  begin.before = before;
  return begin;
}

// The motion between two stops of the path. It also stops at corners on the way, instead of
// rounding them, if that is faster.
class StopChoice {
 public:
  // The motion along some segments without a stop.
  struct Run {
    std::size_t first = 0;
    std::size_t last = 0;
    JerkLimitedSection::Plan plan;
    bool averaged = true;
  };

  StopChoice(const Path& path, const std::vector<TimingLimits>& limits, const TimingStart& begin)
      : path_(path), limits_(limits), begin_(begin) {}

  std::vector<Run> fastest() {
    JerkLimitedSection section(path_, limits_, begin_);
    return optimized(isOfLines() ? alongLines(section) : byAverages(section));
  }

 private:
  std::vector<Run> byAverages(JerkLimitedSection& section) {
    std::vector<std::size_t> corners = cornersOf(section);
    Run whole{0, path_.size() - 1, section.average()};
    if (!whole.plan.possible()) corners.clear();
    if (!corners.empty()) longest_ = whole.plan.duration();
    return choose(path_, std::move(whole), stoppingAt(std::move(corners)));
  }

  // The stops have been chosen by averages, because an optimum takes much longer to find.
  std::vector<Run> optimized(std::vector<Run> runs) const {
    std::vector<Run> found;
    const Path path = withStopsAfter(runs);
    TimingStart begin = begin_;
    for (Run& run : runs) {
      if (!run.plan.possible()) {  // it has no duration
        found.push_back(std::move(run));
        return found;
      }
      const std::size_t first = run.first;
      const Path part = path.part(first, run.last);
      run.last -= first;
      run.first = 0;
      std::vector<Run> of_run = StopChoice(part, limits_, begin).optimum(std::move(run));
      begin = atRest(begin.before + durationOf(of_run));
      for (Run& each : of_run) {
        each.first += first;
        each.last += first;
        found.push_back(std::move(each));
      }
    }
    return found;
  }

  // The optimum found from a motion along the whole path, or those between all stops that may be
  // faster.
  std::vector<Run> optimum(Run whole) {
    std::vector<Run> found;
    JerkLimitedSection section(path_, limits_, begin_);
    found.push_back(std::move(whole));
    if (!found[0].averaged || section.mustAverage()) return found;
    longest_ = found[0].plan.duration();
    std::vector<Run> stopping = stoppingAt(cornersOf(section));
    found[0].plan = section.optimum(found[0].plan);
    const Path path = withStopsAfter(stopping);
    TimingStart begin = begin_;
    for (Run& run : stopping) {
      const Path part = path.part(run.first, run.last);
      if (run.averaged) {
        run.plan = JerkLimitedSection(part, limits_, begin).optimum(run.plan);
      }
      begin = atRest(begin.before + run.plan.duration());
    }
    return stopping.empty() || durationOf(found) <= durationOf(stopping) ? std::move(found)
                                                                         : std::move(stopping);
  }

  Path withStopsAfter(const std::vector<Run>& runs) const {
    std::vector<std::size_t> stops;
    for (std::size_t i = 0; i + 1 < runs.size(); ++i) stops.push_back(runs[i].last);
    return path_.withStops(stops);
  }

  // Those at which a stop may be faster. There is no way to stop on if the motion begins at the end
  // of the first segment.
  std::vector<std::size_t> cornersOf(const JerkLimitedSection& section) const {
    std::vector<std::size_t> corners;
    for (std::size_t i = begin_.parameter > 1.0 - kNoPart ? 1 : 0; i + 1 < path_.size(); ++i) {
      if (path_.isSeparate(i) && section.mayStopAt(i)) corners.push_back(i);
    }
    return corners;
  }

  // Whether it is a motion from rest along lines whose corners are rounded one by one, which won't
  // be continued: the knots of cornerSpeeds() aren't begins of other paths.
  bool isOfLines() const {
    if (begin_.speed > 0.0 || begin_.parameter > 0.0) return false;
    if (path_.continues()) return false;
    for (std::size_t i = 0; i < path_.size(); ++i) {
      if (!path_.isLine(i)) return false;
      const bool last = i + 1 == path_.size();
      if (!last && !(path_.isSeparate(i) && path_.blendAfter(i) > 0.0)) return false;
    }
    return true;
  }

  // The look-ahead chooses the stops and the speeds. Corners at which a stop can't be faster (see
  // mayStopAt()) are better passed at a changing speed: between the stops around them, the moving
  // average is taken if it is faster.
  std::vector<Run> alongLines(const JerkLimitedSection& section) const {
    std::vector<LineBetweenCorners> lines;
    std::vector<RoundedCorner> corners;
    std::vector<bool> gentle;
    for (std::size_t i = 0; i < path_.size(); ++i) {
      lines.push_back(section.lineOf(i));
      if (i + 1 == path_.size()) break;
      corners.push_back(section.cornerAfter(i));
      gentle.push_back(!section.mayStopAt(i));
    }
    const std::vector<double> speeds = cornerSpeeds(lines, corners);
    std::vector<std::size_t> stops;
    for (std::size_t i = 0; i < speeds.size(); ++i) {
      if (speeds[i] == 0.0 && !gentle[i]) stops.push_back(i);
    }
    const Path path = path_.withStops(stops);
    std::vector<Run> chosen;
    stops.push_back(path_.size() - 1);
    std::size_t first = 0;
    TimingStart rest = atRest(begin_.before);
    for (const std::size_t last : stops) {
      std::vector<Run> runs = throughCorners(path.part(first, last), rest,
                                             {speeds.begin() + static_cast<std::ptrdiff_t>(first),
                                              speeds.begin() + static_cast<std::ptrdiff_t>(last)});
      const auto begin = gentle.begin() + static_cast<std::ptrdiff_t>(first);
      if (std::find(begin, begin + static_cast<std::ptrdiff_t>(last - first), true) !=
          begin + static_cast<std::ptrdiff_t>(last - first)) {
        const Path part = path.part(first, last);
        JerkLimitedSection same(part, limits_, rest);
        std::vector<Run> averaged = StopChoice(part, limits_, rest).byAverages(same);
        if (durationOf(averaged) < durationOf(runs)) runs = std::move(averaged);
      }
      rest.before += durationOf(runs);
      for (Run& run : runs) {
        run.first += first;
        run.last += first;
        chosen.push_back(std::move(run));
      }
      first = last + 1;
    }
    return chosen;
  }

  // @param speeds The speeds at the corners; the motion stops at a corner whose speed is 0.
  std::vector<Run> throughCorners(const Path& path, TimingStart rest,
                                  const std::vector<double>& speeds) const {
    std::vector<std::size_t> stops;
    for (std::size_t i = 0; i < speeds.size(); ++i) {
      if (speeds[i] == 0.0) stops.push_back(i);
    }
    const Path stopped = path.withStops(stops);
    stops.push_back(path.size() - 1);
    std::vector<Run> runs;
    std::size_t first = 0;
    for (const std::size_t last : stops) {
      const Path part = stopped.part(first, last);
      Run run{first, last,
              JerkLimitedSection(part, limits_, rest)
                  .throughCorners({speeds.begin() + static_cast<std::ptrdiff_t>(first),
                                   speeds.begin() + static_cast<std::ptrdiff_t>(last)}),
              false};
      // A slowdown as a whole isn't known to the look-ahead.
      std::vector<Run> stopping;
      if (first < last && run.plan.slowdown > 1.0 + kNoExcess) {
        stopping = throughCorners(part, rest, std::vector<double>(last - first, 0.0));
      }
      if (stopping.empty() || run.plan.duration() <= durationOf(stopping)) {
        stopping.clear();
        stopping.push_back(std::move(run));
        stopping.back().first = 0;
        stopping.back().last = last - first;
      }
      rest.before += durationOf(stopping);
      for (Run& each : stopping) {
        each.first += first;
        each.last += first;
        runs.push_back(std::move(each));
      }
      first = last + 1;
    }
    return runs;
  }

  static double durationOf(const std::vector<Run>& runs) {
    double duration = 0.0;
    for (const Run& run : runs) duration += run.plan.duration();
    return duration;
  }

  Run planned(const Path& path, std::size_t first, std::size_t last) const {
    const Path part = path.part(first, last);
    const TimingStart begin = first == 0 ? begin_ : atRest(begin_.before + longest_);
    JerkLimitedSection section(part, limits_, begin);
    const bool line = first == last && StopChoice(part, limits_, begin).isOfLines();
    return {first, last, line ? section.throughCorners({}) : section.average(), !line};
  }

  // The runs from one corner to the next. Those at which a motion that begins at a speed can't stop
  // are left out.
  std::vector<Run> stoppingAt(std::vector<std::size_t> corners) const {
    std::vector<Run> runs;
    for (std::size_t left_out = 1; runs.empty() && !corners.empty(); left_out *= 2) {
      Run run = planned(path_.withStops(corners), 0, corners.front());
      if (run.plan.possible()) {
        runs.push_back(std::move(run));
      } else {
        const std::size_t count = std::min(left_out, corners.size());
        corners.erase(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(count));
      }
    }
    if (corners.empty()) return runs;
    const Path path = path_.withStops(corners);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::size_t end = i + 1 < corners.size() ? corners[i + 1] : path_.size() - 1;
      runs.push_back(planned(path, corners[i] + 1, end));
    }
    return runs;
  }

  // @param path The path with the stops that have been chosen.
  // @param stopping The runs from one corner to the next along the way of `whole`.
  std::vector<Run> choose(const Path& path, Run whole, std::vector<Run> stopping) const {
    std::vector<Run> chosen;
    if (stopping.size() < 2 || whole.plan.duration() <= durationOf(stopping)) {
      chosen.push_back(std::move(whole));
      return chosen;
    }
    const std::vector<bool> stops = slowCorners(whole, stopping);
    std::vector<std::size_t> corners;
    for (std::size_t i = 0; i + 1 < stopping.size(); ++i) {
      if (stops[i]) corners.push_back(stopping[i].last);
    }
    const Path stopped = path.withStops(corners);
    std::vector<Run> between;  // the runs since the last stop
    for (std::size_t i = 0; i < stopping.size(); ++i) {
      between.push_back(std::move(stopping[i]));
      if (!stops[i]) continue;
      if (between.size() > 1) {
        Run run = planned(stopped, between.front().first, between.back().last);
        between = choose(stopped, std::move(run), std::move(between));
      }
      std::move(between.begin(), between.end(), std::back_inserter(chosen));
      between.clear();
    }
    return chosen;
  }

  // Returns for each run whether it and the next one take longer in the whole motion. If the whole
  // motion takes longer than its runs, this is so at one corner at least. The last run ends at a
  // stop.
  static std::vector<bool> slowCorners(const Run& whole, const std::vector<Run>& stopping) {
    std::vector<double> lost;
    lost.reserve(stopping.size());
    for (const Run& run : stopping) lost.push_back(timeIn(whole, run) - run.plan.duration());
    std::vector<bool> slow(stopping.size(), false);
    std::size_t worst = 0;
    for (std::size_t i = 0; i + 1 < stopping.size(); ++i) {
      slow[i] = lost[i] + lost[i + 1] > 0.0;
      if (lost[i] + lost[i + 1] > lost[worst] + lost[worst + 1]) worst = i;
    }
    slow[worst] = slow.back() = true;
    return slow;
  }

  // [s] How long a motion takes for the segments of a run.
  static double timeIn(const Run& whole, const Run& run) {
    const JerkLimitedSection::Plan& plan = whole.plan;
    const auto end_of = [&](std::size_t segment) {
      const auto later =
          std::upper_bound(plan.segments.begin() + 1, plan.segments.end(), segment - whole.first);
      return plan.knots[static_cast<std::size_t>(later - plan.segments.begin()) - 1].time;
    };
    const double begin = run.first == whole.first ? 0.0 : end_of(run.first - 1);
    return (end_of(run.last) - begin) * plan.slowdown;
  }

  const Path& path_;
  const std::vector<TimingLimits>& limits_;
  const TimingStart& begin_;
  double longest_ = 0.0;  // [s] No run begins later than this after begin_.
};

// The end of a segment, at rest.
TimingKnot restAtEnd(const Path& path, std::size_t segment) {
  PathPoint end;
  path.evaluate(segment, 1.0, end);
  TimingKnot knot;
  knot.segment = segment;
  knot.positions = std::move(end.position);
  knot.velocities.assign(path.axes(), 0.0);
  knot.accelerations.assign(path.axes(), 0.0);
  knot.parameter = 1.0;
  knot.may_begin = true;
  return knot;
}

// Appends a motion to rest. @param ago see TimingStart.
void appendRun(const JerkLimitedSection::Plan& plan, std::size_t first, double ago,
               PathTiming& made) {
  const std::int64_t begin_ns = made.knots.empty() ? 0 : made.knots.back().time_ns;
  const double end = static_cast<double>(begin_ns) * 1e-9 + plan.duration();
  if (!(end < Profile::kLongest)) {
    throw TooLong("the motion along the path would take longer than 4e9 s");
  }
  const double factor = plan.slowdown;
  made.settled_ns = begin_ns + std::llround(plan.settled * factor * 1e9);
  for (std::size_t i = made.knots.empty() ? 0 : 1; i < plan.knots.size(); ++i) {
    const JerkLimitedKnots::Knot& planned = plan.knots[i];
    const double time = planned.time * factor - ago;
    const std::int64_t time_ns = std::llround(time * 1e9);
    const double later = static_cast<double>(time_ns) * 1e-9 - time;
    TimingKnot knot;
    knot.time_ns = begin_ns + time_ns;
    knot.segment = first + plan.segments[i];
    knot.parameter = planned.parameter;
    knot.speed = planned.speed / factor;
    knot.acceleration = planned.acceleration / (factor * factor);
    knot.may_begin = planned.even;
    knot.average = plan.time * factor;
    knot.straight = plan.straight[i];
    for (std::size_t j = 0; j < plan.knots.axes(); ++j) {
      const JerkLimitedKnots::State& state = plan.knots.state(i, j);
      const double velocity = state.velocity / factor;
      const double acceleration = state.acceleration / (factor * factor);
      knot.positions.push_back(state.position + later * (velocity + later * acceleration / 2.0));
      knot.velocities.push_back(velocity + later * acceleration);
      knot.accelerations.push_back(acceleration);
    }
    made.knots.push_back(std::move(knot));
  }
}

}  // namespace

PathTiming planJerkLimited(const Path& path, const std::vector<TimingLimits>& limits,
                           const TimingStart& begin) {
  PathTiming made;
  TimingStart from = begin;
  for (std::size_t first = 0; first < path.size();) {
    std::size_t last = first;
    while (last + 1 < path.size() && !path.stopsAfter(last)) ++last;
    // It begins at a stop.
    if (first == last && from.parameter > 1.0 - kNoPart) {
      if (from.speed > 0.0) made.excess = kUnlimited;
      made.knots.push_back(restAtEnd(path, first));
      from = atRest(from.before);
      ++first;
      continue;
    }
    const Path part = path.part(first, last);
    const std::vector<StopChoice::Run> runs = StopChoice(part, limits, from).fastest();
    for (const StopChoice::Run& run : runs) {
      made.excess = std::max(made.excess, run.plan.excess);
      if (!run.plan.possible()) return made;
      if (run.first > 0) made.stops.push_back(first + run.first - 1);
      const std::int64_t settled_ns = made.settled_ns;
      appendRun(run.plan, first + run.first, from.ago, made);
      // If the last run is continued, the corner before it may be passed instead.
      if (runs.size() > 1 && &run == &runs.back()) made.settled_ns = settled_ns;
      from = atRest(begin.before + static_cast<double>(made.knots.back().time_ns) * 1e-9);
    }
    first = last + 1;
  }
  return made;
}

}  // namespace stepdriver::motion
