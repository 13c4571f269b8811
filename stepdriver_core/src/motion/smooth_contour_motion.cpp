#include "smooth_contour_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <utility>

#include "contour_grid.h"
#include "contour_smoothing.h"
#include "contour_speed.h"
#include "motion/profile.h"

namespace stepdriver::motion {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
// [s] Knots aren't closer than this, nor than a rounded position may change the jerk by a
// thousandth of its limit: a quintic has 60/h^3 of that.
constexpr double kClosestKnots = 100e-6;
constexpr double kMostRounding = 1e-3 / 60.0;
constexpr double kSmallChange = 0.05;  // of the jerk, in parts of its limit: no knot
constexpr int kMostReplans = 12;
constexpr double kNoExcess = 1e-3;
constexpr double kNoDifference = 1e-6;
constexpr double kLowerSmoothBy = 1.002;
constexpr double kShorterBy = 0.7;             // the time of the average
constexpr double kShortestAverage = 1e-3;      // s
constexpr double kMostSmoothDeviation = 0.05;  // of the resolution
constexpr int kMostQuarterings = 4;

// The knots of a motion between two stops, at any time.
class SmoothKnots {
 public:
  explicit SmoothKnots(std::size_t axes) : axes_(axes) {}

  struct Knot {
    double time = 0.0;
    double distance = 0.0;
    double speed = 0.0;
    std::size_t interval = 0;
    std::size_t part = 0;  // of the smoothed motion, that ends or contains it
  };

  void append(const Knot& knot, const double* position, const double* first, const double* second,
              double acceleration) {
    knots_.push_back(knot);
    const double square = knot.speed * knot.speed;
    for (std::size_t j = 0; j < axes_; ++j) {
      states_.push_back(
          {position[j], first[j] * knot.speed, first[j] * acceleration + second[j] * square});
    }
  }
  void dropLast() {
    knots_.pop_back();
    states_.resize(states_.size() - axes_);
  }

  struct State {
    double position = 0.0;
    double velocity = 0.0;
    double acceleration = 0.0;
  };

  std::size_t size() const { return knots_.size(); }
  const Knot& operator[](std::size_t index) const { return knots_[index]; }
  const Knot& back() const { return knots_.back(); }
  const State& state(std::size_t index, std::size_t axis) const {
    return states_[index * axes_ + axis];
  }

 private:
  std::size_t axes_;
  std::vector<Knot> knots_;
  std::vector<State> states_;
};

// The largest parts of their limits that the axes use, or 1.
struct SmoothDemand {
  double speed = 1.0;
  double acceleration = 1.0;
  double jerk = 1.0;

  void include(const SmoothDemand& other) {
    speed = std::max(speed, other.speed);
    acceleration = std::max(acceleration, other.acceleration);
    jerk = std::max(jerk, other.jerk);
  }
  // How much slower the motion has to be.
  double slowdown() const { return std::max({speed, std::sqrt(acceleration), std::cbrt(jerk)}); }
};

// A quintic over u from 0 to 1.
class QuinticDemand {
 public:
  QuinticDemand(const SmoothKnots::State& begin, const SmoothKnots::State& end, double duration)
      : h_(duration), v0_(begin.velocity), v1_(end.velocity), a0_(begin.acceleration) {
    const double way = end.position - begin.position;
    const double v0 = h_ * v0_;
    const double v1 = h_ * v1_;
    const double a0 = h_ * h_ * a0_ / 2.0;
    const double a1 = h_ * h_ * end.acceleration / 2.0;
    c3_ = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1;
    c4_ = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1;
    c5_ = 6.0 * way - 3.0 * v0 - 3.0 * v1 - a0 + a1;
  }

  SmoothDemand of(const ContourLimits& limits) const {
    const int direction = directionOf(v0_, v1_);
    SmoothDemand demand;
    const auto take_speed = [&](double u) {
      demand.speed = std::max(demand.speed, std::abs(velocity(u)) / limits.speed);
    };
    const auto take_acceleration = [&](double u) {
      const double a = acceleration(u);
      demand.acceleration =
          std::max(demand.acceleration,
                   std::abs(a) / accelerationTowards(limits, direction, a > 0.0 ? 1 : -1));
    };
    double most_jerk = 0.0;
    const auto take_jerk = [&](double u) { most_jerk = std::max(most_jerk, std::abs(jerk(u))); };
    // The acceleration is monotonic from one of these to the next.
    std::array<double, 4> turns{0.0, 1.0, 1.0, 1.0};
    std::size_t count = 1;
    for (const double u : rootsOfJerk()) {
      if (u > turns[count - 1] && u < 1.0) turns[count++] = u;
    }
    turns[count++] = 1.0;
    for (std::size_t i = 0; i < count; ++i) {
      take_acceleration(turns[i]);
    }
    take_jerk(0.0);
    take_jerk(1.0);
    const double level = -c4_ / (5.0 * c5_);
    if (level > 0.0 && level < 1.0) take_jerk(level);
    demand.jerk = std::max(demand.jerk, most_jerk / limits.jerk);
    take_speed(0.0);
    take_speed(1.0);
    const double above = std::max(std::abs(v0_), std::abs(v1_)) + h_ * h_ / 8.0 * most_jerk;
    if (above <= limits.speed) return demand;
    for (std::size_t i = 0; i + 1 < count; ++i) {
      double low = turns[i];
      double high = turns[i + 1];
      if (acceleration(low) * acceleration(high) >= 0.0) continue;
      constexpr int kHalvings = 40;
      for (int k = 0; k < kHalvings; ++k) {
        const double middle = (low + high) / 2.0;
        (acceleration(low) * acceleration(middle) > 0.0 ? low : high) = middle;
      }
      take_speed(low);
    }
    return demand;
  }

 private:
  double velocity(double u) const {
    return v0_ + u * (a0_ * h_ + u * (3.0 * c3_ + u * (4.0 * c4_ + u * 5.0 * c5_)) / h_);
  }
  double acceleration(double u) const {
    return a0_ + u * (6.0 * c3_ + u * (12.0 * c4_ + u * 20.0 * c5_)) / (h_ * h_);
  }
  double jerk(double u) const {
    return (6.0 * c3_ + u * (24.0 * c4_ + u * 60.0 * c5_)) / (h_ * h_ * h_);
  }
  // In increasing order; NaN if there is none.
  std::array<double, 2> rootsOfJerk() const {
    // 10 c5 u^2 + 4 c4 u + c3 = 0
    const double root = std::sqrt(4.0 * c4_ * c4_ - 10.0 * c5_ * c3_);
    const double sum = -(2.0 * c4_ + std::copysign(root, c4_));
    const double a = sum / (10.0 * c5_);
    const double b = c3_ / sum;
    return {std::min(a, b), std::max(a, b)};
  }

  double h_;
  double v0_;
  double v1_;
  double a0_;
  double c3_ = 0.0;
  double c4_ = 0.0;
  double c5_ = 0.0;
};

// [unit/s^3] The highest s''' at which the axes keep to their jerk limits on a straight line in the
// directions of an interval, and build up their accelerations in this time at the earliest.
double highestJerk(const ContourGrid& grid, std::size_t interval,
                   const std::vector<ContourLimits>& limits, double time) {
  double highest = kUnlimited;
  for (std::size_t j = 0; j < limits.size(); ++j) {
    const double part =
        std::max(std::abs(grid.firstAtBegin(interval)[j]), std::abs(grid.firstAtEnd(interval)[j]));
    const double acceleration = std::max(limits[j].acceleration, limits[j].deceleration);
    const double jerk = std::min(limits[j].jerk, acceleration / time);
    if (part > 0.0) highest = std::min(highest, jerk / part);
  }
  return highest;
}

// When a part of a smoothed motion has moved by a distance [s], before it ends.
double timeTo(const SmoothPart& part, double distance, double duration) {
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

// The knots of a smoothed motion: when its jerk changes, and at the places of a grid.
class KnotMaker {
 public:
  KnotMaker(const ContourGrid& grid, const std::vector<ContourLimits>& limits,
            const std::vector<SmoothPart>& parts, double time, double closest)
      : grid_(grid),
        limits_(limits),
        parts_(parts),
        time_(time),
        closest_(closest),
        knots_(grid.axes()) {}

  SmoothKnots make() {
    appendPlace(0, parts_.front(), 0.0, 0);
    double jerk = parts_.front().jerk;
    for (std::size_t k = 0; k + 1 < parts_.size(); ++k) {
      giveWayAt(k);
      const SmoothPart& part = parts_[k];
      if (std::abs(part.jerk - jerk) >
          kSmallChange * highestJerk(grid_, interval_, limits_, time_)) {
        appendBegin(part, k);
        jerk = part.jerk;
      }
      const SmoothPart& next = parts_[k + 1];
      while (interval_ + 1 < grid_.size() && begin_ + grid_[interval_].length < next.distance) {
        const bool curved = !grid_[interval_].straight || !grid_[interval_ + 1].straight;
        begin_ += grid_[interval_].length;
        ++interval_;
        if (!curved || begin_ <= part.distance) continue;
        const double h = timeTo(part, begin_ - part.distance, next.time - part.time);
        appendPlace(interval_, part, h, k);
      }
    }
    if (knots_.size() > 1 && parts_.back().time - knots_.back().time < closest_) {
      knots_.dropLast();
    }
    appendPlace(grid_.size(), parts_.back(), 0.0, parts_.size() - 1);
    return std::move(knots_);
  }

 private:
  bool tooClose(double time) const {
    return knots_.size() > 0 && time - knots_.back().time < closest_;
  }

  void appendBegin(const SmoothPart& part, std::size_t index) {
    if (tooClose(part.time)) return;
    grid_.evaluateAt(interval_, part.distance - begin_, point_);
    knots_.append({part.time, part.distance, part.speed, interval_, index}, point_.position.data(),
                  point_.first.data(), point_.second.data(), part.acceleration);
  }

  void appendPlace(std::size_t place, const SmoothPart& part, double h, std::size_t index) {
    if (tooClose(part.time + h)) return;
    const std::size_t before = place == 0 ? 0 : place - 1;
    const double* first = place == 0 ? grid_.firstAtBegin(0) : grid_.firstAtEnd(before);
    const double* second = place == 0 ? grid_.secondAtBegin(0) : grid_.secondAtEnd(before);
    const double speed = part.speed + h * (part.acceleration + h * part.jerk / 2.0);
    const double distance =
        part.distance + h * (part.speed + h * (part.acceleration / 2.0 + h * part.jerk / 6.0));
    knots_.append({part.time + h, distance, speed, before, index}, grid_.position(place), first,
                  second, part.acceleration + h * part.jerk);
  }

  const ContourGrid& grid_;
  const std::vector<ContourLimits>& limits_;
  const std::vector<SmoothPart>& parts_;
  double time_;     // of the average
  double closest_;  // [s] knots
  SmoothKnots knots_;
  ContourPoint point_;
  std::size_t interval_ = 0;  // that contains the motion
  double begin_ = 0.0;        // of it [unit]
};

// The motion between two stops.
class SmoothSection {
 public:
  SmoothSection(const Contour& contour, const std::vector<ContourLimits>& limits)
      : contour_(contour), limits_(limits), grid_(contour) {
    findCaps();
  }

  struct Plan {
    SmoothKnots knots;
    std::vector<std::size_t> segments;  // of the knots
    double slowdown = 1.0;
    double duration() const { return knots.back().time * slowdown; }
  };

  // Divides intervals in which quintics would deviate from the contour.
  Plan fastest() {
    for (int i = 0;; ++i) {
      Plan best = bestOfTimes();
      std::vector<bool> deviates(grid_.size(), false);
      if (i == kMostQuarterings || !findDeviations(best.knots, deviates)) return best;
      grid_.quarter(deviates);
      findCaps();
    }
  }

 private:
  // What has been lowered because a quintic exceeded a limit.
  struct Lowered {
    std::vector<CeilingSpan> speeds;
    std::vector<CeilingSpan> accelerations;
  };

  void findCaps() {
    const ContourSpeed speed(contour_, grid_, limits_);
    caps_.clear();
    double distance = 0.0;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      caps_.push_back({distance, distance + grid_[i].length, capOf(i, speed)});
      distance += grid_[i].length;
    }
  }

  bool moves(std::size_t axis) const {
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      if (std::abs(grid_.firstAtBegin(i)[axis]) > kNoDifference) return true;
    }
    return false;
  }

  double closestKnots() const {
    double closest = kClosestKnots;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      double farthest = 0.0;
      for (std::size_t i = 0; i <= grid_.size(); ++i) {
        farthest = std::max(farthest, std::abs(grid_.position(i)[j]));
      }
      const double rounding = farthest * std::numeric_limits<double>::epsilon();
      closest = std::max(closest, std::cbrt(rounding / (kMostRounding * limits_[j].jerk)));
    }
    return closest;
  }

  // How far the middle of the quintic that ends at a knot is from the contour, at a right angle.
  double deviationOf(const SmoothKnots& knots, std::size_t index, std::size_t interval,
                     double distance) const {
    const double h = knots[index].time - knots[index - 1].time;
    ContourPoint point;
    double square = 0.0;
    constexpr int kProjections = 3;
    for (int i = 0; i < kProjections; ++i) {
      grid_.evaluateAt(interval, distance - caps_[interval].from, point);
      double along = 0.0;
      square = 0.0;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        const SmoothKnots::State& begin = knots.state(index - 1, j);
        const SmoothKnots::State& end = knots.state(index, j);
        const double off = (begin.position + end.position) / 2.0 +
                           h * (5.0 / 32.0 * (begin.velocity - end.velocity) +
                                h * (begin.acceleration + end.acceleration) / 64.0) -
                           point.position[j];
        square += off * off;
        along += off * point.first[j];
      }
      square -= along * along;
      distance += along;
    }
    return std::sqrt(std::max(0.0, square));
  }

  bool findDeviations(const SmoothKnots& knots, std::vector<bool>& deviates) const {
    bool found = false;
    std::size_t interval = 0;
    for (std::size_t i = 1; i < knots.size(); ++i) {
      giveWayAt(i);
      const double middle = (knots[i - 1].distance + knots[i].distance) / 2.0;
      while (interval + 1 < grid_.size() && caps_[interval].to < middle) ++interval;
      if (grid_[interval].straight) continue;
      if (deviationOf(knots, i, interval, middle) < kMostSmoothDeviation * contour_.resolution())
        continue;
      deviates[interval] = found = true;
    }
    return found;
  }

  Plan bestOfTimes() const {
    double time = 0.0;
    double jerk = kUnlimited;
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      if (!moves(j)) continue;
      const double acceleration = std::max(limits_[j].acceleration, limits_[j].deceleration);
      time = std::max(time, acceleration / limits_[j].jerk);
      jerk = std::min(jerk, limits_[j].jerk);
    }
    // On a straight line without other limits, four parts of this duration are the fastest.
    time = std::max(kShortestAverage, std::min(time, std::cbrt(caps_.back().to / (2.0 * jerk))));
    Plan best = plan(time);
    int worse = 0;
    while (worse < 2 && time * kShorterBy > kShortestAverage) {
      time *= kShorterBy;
      Plan next = plan(time);
      if (next.duration() < best.duration()) {
        best = std::move(next);
        worse = 0;
      } else {
        ++worse;
      }
    }
    return best;
  }

  double capOf(std::size_t interval, const ContourSpeed& speed) const;

  Plan plan(double time) const {
    Lowered lowered;
    Plan best = planOnce(time, lowered);
    for (int i = 1; i < kMostReplans && best.slowdown > 1.0 + kNoExcess; ++i) {
      Plan next = planOnce(time, lowered);
      const bool done = next.slowdown <= 1.0 + kNoExcess;
      if (next.duration() < best.duration()) best = std::move(next);
      if (done) break;
    }
    return best;
  }

  // Adds to what is lowered.
  Plan planOnce(double time, Lowered& lowered) const {
    std::vector<CeilingSpan> spans;
    spans.reserve(caps_.size() + lowered.speeds.size());
    for (const std::vector<CeilingSpan>* some : {&caps_, &std::as_const(lowered.speeds)}) {
      for (const CeilingSpan& span : *some) {
        const double reach = span.value * time / 2.0;
        spans.push_back({span.from - reach, span.to + reach, span.value});
      }
    }
    const Ceiling speeds(std::move(spans));
    const Ceiling accelerations(lowered.accelerations);
    std::vector<double> cuts;
    std::merge(speeds.places().begin(), speeds.places().end(), accelerations.places().begin(),
               accelerations.places().end(), std::back_inserter(cuts));
    const ContourGrid grid = grid_.divided(cuts);
    ContourSpeed speed(contour_, grid, limits_);
    double begin = 0.0;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      giveWayAt(i);
      const double end = begin + grid[i].length;
      const double margin = kMargin * grid[i].length;
      const double highest = speeds.lowest(begin + margin, end - margin);
      speed.restrict(i, highest * highest,
                     std::min(time * highestJerk(grid, i, limits_, time),
                              accelerations.lowest(begin + margin, end - margin)));
      begin = end;
    }
    speed.plan();
    const std::vector<SmoothPart> parts = smoothed(flattenPeaks(placesOf(grid, speed), time), time);
    Plan plan{KnotMaker(grid, limits_, parts, time, closestKnots()).make(), {}, 1.0};
    for (std::size_t i = 0; i < plan.knots.size(); ++i) {
      plan.segments.push_back(grid[plan.knots[i].interval].segment);
    }
    plan.slowdown = lower(plan.knots, parts, grid, lowered).slowdown();
    return plan;
  }

  static std::vector<SpeedPlace> placesOf(const ContourGrid& grid, const ContourSpeed& speed) {
    std::vector<SpeedPlace> places{{0.0, 0.0}};
    places.reserve(3 * grid.size());
    double begin = 0.0;
    const auto append = [&](double distance, double square) {
      if (distance > places.back().distance) places.push_back({distance, square});
    };
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const double end = begin + grid[i].length;
      if (grid[i].straight) {
        const ContourSpeed::Ramp ramp = speed.ramp(i);
        const double peak = speed.peakSquare(i);
        append(begin + (peak - speed.square(i)) / (2.0 * ramp.up), peak);
        append(std::min(end, end - (peak - speed.square(i + 1)) / (2.0 * ramp.down)), peak);
      }
      append(end, speed.square(i + 1));
      begin = end;
    }
    return places;
  }

  SmoothDemand lower(const SmoothKnots& knots, const std::vector<SmoothPart>& parts,
                     const ContourGrid& grid, Lowered& lowered) const {
    SmoothDemand worst;
    for (std::size_t i = 1; i < knots.size(); ++i) {
      giveWayAt(i);
      SmoothDemand demand;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        demand.include(QuinticDemand(knots.state(i - 1, j), knots.state(i, j),
                                     knots[i].time - knots[i - 1].time)
                           .of(limits_[j]));
      }
      worst.include(demand);
      const double slowdown = demand.slowdown();
      if (slowdown < 1.0 + kNoDifference) continue;
      bool straight = true;
      for (std::size_t k = knots[i - 1].interval; k <= knots[i].interval; ++k) {
        straight = straight && grid[k].straight;
      }
      const std::size_t last = std::min(knots[i].part + 1, parts.size() - 1);
      double acceleration = 0.0;
      for (std::size_t k = knots[i - 1].part; k < last; ++k) {
        acceleration = std::max({acceleration, std::abs(parts[k].rear_acceleration),
                                 std::abs(parts[k].front_acceleration)});
      }
      if (!straight || demand.speed > 1.0) {
        lowered.speeds.push_back({knots[i - 1].distance, knots[i].distance,
                                  std::max(knots[i - 1].speed, knots[i].speed) /
                                      ((straight ? demand.speed : slowdown) * kLowerSmoothBy)});
      }
      if (acceleration > 0.0) {
        const double by =
            straight ? std::max(demand.acceleration, demand.jerk) : slowdown * slowdown;
        lowered.accelerations.push_back({parts[knots[i - 1].part].rear, parts[last].front,
                                         acceleration / (by * kLowerSmoothBy)});
      }
    }
    return worst;
  }

  static constexpr double kMargin = 1e-9;  // of an interval, for rounding

  const Contour& contour_;
  const std::vector<ContourLimits>& limits_;
  ContourGrid grid_;
  std::vector<CeilingSpan> caps_;  // of the speed, of each interval
};

// [unit/s] The highest constant speed along an interval.
double SmoothSection::capOf(std::size_t interval, const ContourSpeed& speed) const {
  double cap = std::sqrt(std::min(speed.capAtBegin(interval), speed.capAtEnd(interval)));
  if (grid_[interval].straight) return cap;
  ContourPoint middle;
  const double length = grid_[interval].length;
  grid_.evaluateAt(interval, length / 2.0, middle);
  for (std::size_t j = 0; j < limits_.size(); ++j) {
    const double begin = grid_.secondAtBegin(interval)[j];
    const double end = grid_.secondAtEnd(interval)[j];
    // Of the parabola through the three.
    const double third = std::max(std::abs(-3.0 * begin + 4.0 * middle.second[j] - end),
                                  std::abs(begin - 4.0 * middle.second[j] + 3.0 * end)) /
                         length;
    const double second = std::max({std::abs(begin), std::abs(middle.second[j]), std::abs(end)});
    const double acceleration = std::min(limits_[j].acceleration, limits_[j].deceleration);
    if (second > 0.0) cap = std::min(cap, std::sqrt(acceleration / second));
    if (third > 0.0) cap = std::min(cap, std::cbrt(limits_[j].jerk / third));
  }
  return cap;
}

}  // namespace

std::vector<ContourKnot> planSmoothContour(const Contour& contour,
                                           const std::vector<ContourLimits>& limits) {
  std::vector<ContourKnot> made;
  std::int64_t begin_ns = 0;
  for (std::size_t first = 0; first < contour.size();) {
    std::size_t last = first;
    while (last + 1 < contour.size() && !contour.stopsAfter(last)) ++last;
    const Contour part = contour.part(first, last);
    const SmoothSection::Plan plan = SmoothSection(part, limits).fastest();
    const double end = static_cast<double>(begin_ns) * 1e-9 + plan.duration();
    if (!(end < Profile::kLongest)) {
      throw std::range_error("the motion along the path would take longer than 4e9 s");
    }
    const double factor = plan.slowdown;
    for (std::size_t i = made.empty() ? 0 : 1; i < plan.knots.size(); ++i) {
      const double time = plan.knots[i].time * factor;
      const std::int64_t time_ns = std::llround(time * 1e9);
      const double later = static_cast<double>(time_ns) * 1e-9 - time;
      ContourKnot knot;
      knot.time_ns = begin_ns + time_ns;
      knot.segment = first + plan.segments[i];
      for (std::size_t j = 0; j < contour.axes(); ++j) {
        const SmoothKnots::State& state = plan.knots.state(i, j);
        const double velocity = state.velocity / factor;
        const double acceleration = state.acceleration / (factor * factor);
        knot.positions.push_back(state.position + later * (velocity + later * acceleration / 2.0));
        knot.velocities.push_back(velocity + later * acceleration);
        knot.accelerations.push_back(acceleration);
      }
      made.push_back(std::move(knot));
    }
    begin_ns = made.back().time_ns;
    first = last + 1;
  }
  return made;
}

}  // namespace stepdriver::motion
