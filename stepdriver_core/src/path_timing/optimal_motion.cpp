#include "optimal_motion.h"

#include <algorithm>
#include <cmath>

#include "give_way.h"
#include "knot_quintic.h"

namespace stepdriver::motion {
namespace {

// A change of the jerk is moved by half a piece at most. A tenth of the time in which an
// acceleration builds up makes a motion of two such times longer by less than 1 %, and pieces that
// are half as long need twice the time to plan.
constexpr double kPieceOfAverage = 0.1;
// A motion that lasts longer than so many pieces has longer ones, in addition to the places of
// curves: a change of the jerk is moved by 1/400,000 of the motion at most.
constexpr double kMostTimedPieces = 200'000.0;
// The jerk within a piece is proportional to the speed, which grows with t^2 after a rest. A piece
// that takes an eighth of the time since the rest, or of that until it, changes it by a quarter.
constexpr double kPartOfTimeAtRest = 0.125;
// A piece isn't divided if one of its parts would be shorter than this part of the others: what a
// short one adds to the second derivative of the square of the speed is the limit of its
// neighbours.
constexpr double kShortPart = 0.3;
// The acceleration changes in the optimum where it changes in the other motion, or near to that. A
// piece that is so far from a change that it takes this part of the time to it may be longer, by
// the same reason as at a rest.
constexpr double kPartOfTimeToChange = 0.125;
// No piece is longer than this part of the motion: along a curve, the optimum changes its
// acceleration everywhere.
constexpr double kFewestTimedPieces = 400.0;
// An acceleration changes if it would build up in ten times the time of the average.
constexpr double kChange = 0.1;
// A stop along the path lowers the rate of its time from 1 to 1 - y. What the motion itself needs
// of the jerk J falls with (1 - y)^3, so that y'' may be (m + 3 y) J/v at the speed v if the motion
// leaves the part m of J at first: y = m/3 (cosh(w t) - 1) with w = sqrt(3 J/v). Without any
// part, a stop can't begin at a place at which J is reached. With 0.15 it has reached y = 1/2 after
// 3.1/w, with half of that after 3.7/w. In the same way, the acceleration a allows a y' of
// (m + 2 y) a/v, and y = m/2 (exp(2 a t/v) - 1), which takes 3 v/2a with m = 0.05.
constexpr double kJerkForStop = 0.15;
constexpr double kAccelerationForStop = 0.05;
// Two pieces at rest at their ends, and two between them.
constexpr std::size_t kFewestPieces = 4;

// [unit^2/s^2] The square of the speed of a motion at a distance, between its samples.
class SampledSpeed {
 public:
  void append(double distance, double speed) {
    distances_.push_back(distance);
    squares_.push_back(speed * speed);
  }
  const std::vector<double>& distances() const { return distances_; }

  /// The distances never become smaller.
  double squareAt(double distance) {
    while (next_ + 1 < distances_.size() && distances_[next_] < distance) ++next_;
    if (next_ == 0 || distance >= distances_[next_]) return squares_[next_];
    const double before = distances_[next_ - 1];
    const double part = (distance - before) / (distances_[next_] - before);
    return squares_[next_ - 1] + part * (squares_[next_] - squares_[next_ - 1]);
  }

 private:
  std::vector<double> distances_;
  std::vector<double> squares_;
  std::size_t next_ = 0;
};

// The times between which the acceleration of a motion changes.
class Changes {
 public:
  /// @param average [s] the time over which the motion was averaged
  Changes(const JerkLimitedKnots& knots, double average) {
    double most = 0.0;
    for (std::size_t i = 0; i < knots.size(); ++i) {
      most = std::max(most, std::abs(knots[i].acceleration));
    }
    for (std::size_t i = 1; i < knots.size(); ++i) {
      const double change = std::abs(knots[i].acceleration - knots[i - 1].acceleration);
      const double duration = knots[i].time - knots[i - 1].time;
      if (change * average > kChange * most * duration) {
        spans_.push_back({knots[i - 1].time, knots[i].time});
      }
    }
  }

  /// [s] How far a time is from the nearest change; 0 within one. The times never become smaller.
  double distanceTo(double time) {
    while (next_ < spans_.size() && spans_[next_].end < time) ++next_;
    const double after = next_ < spans_.size() ? spans_[next_].begin - time : time;
    const double before = next_ > 0 ? time - spans_[next_ - 1].end : time;
    return std::max(0.0, std::min(after, before));
  }

 private:
  struct Span {
    double begin;
    double end;
  };
  std::vector<Span> spans_;
  std::size_t next_ = 0;
};

// At the times at which pieces may end.
SampledSpeed sampled(const JerkLimitedKnots& knots, double average) {
  SampledSpeed speed;
  const double whole = knots.back().time;
  const double piece = std::max(average * kPieceOfAverage, whole / kMostTimedPieces);
  Changes changes(knots, average);
  std::size_t next = 1;
  for (double time = piece; time < whole - piece;) {
    giveWayAt(next);
    while (next + 1 < knots.size() && knots[next].time < time) ++next;
    const auto along = [](const JerkLimitedKnots::Knot& knot) -> JerkLimitedKnots::State {
      return {knot.distance, knot.speed, knot.acceleration};
    };
    const double h = knots[next].time - knots[next - 1].time;
    const KnotQuintic curve(along(knots[next - 1]), along(knots[next]), h);
    const double u = (time - knots[next - 1].time) / h;
    speed.append(curve.position(u), curve.velocity(u));
    const double longest = std::clamp(kPartOfTimeToChange * changes.distanceTo(time), piece,
                                      std::max(piece, whole / kFewestTimedPieces));
    time += std::min(longest, kPartOfTimeAtRest * std::min(time, whole - time));
  }
  return speed;
}

// The derivatives of an axis with respect to the length along an interval: the second one is the
// parabola through its values at both ends and in the middle.
class AxisAlong {
 public:
  AxisAlong(const PathGrid& grid, std::size_t interval, std::size_t axis, double middle)
      : first_(grid.firstAtBegin(interval)[axis]) {
    if (grid[interval].straight) return;
    const double length = grid[interval].length;
    const double end = grid.secondAtEnd(interval)[axis];
    second_ = grid.secondAtBegin(interval)[axis];
    third_ = (-3.0 * second_ + 4.0 * middle - end) / length;
    fourth_ = 4.0 * (second_ - 2.0 * middle + end) / (length * length);
  }
  PathDerivatives at(double s) const {
    return {first_ + s * (second_ + s * (third_ / 2.0 + s * fourth_ / 6.0)),
            second_ + s * (third_ + s * fourth_ / 2.0), third_ + s * fourth_};
  }

 private:
  double first_;
  double second_ = 0.0;
  double third_ = 0.0;
  double fourth_ = 0.0;
};

// The limits less what a stop along the path needs of them.
std::vector<TimingLimits> limitsWithStop(std::vector<TimingLimits> limits) {
  for (TimingLimits& each : limits) {
    each.acceleration *= 1.0 - kAccelerationForStop;
    each.deceleration *= 1.0 - kAccelerationForStop;
    each.jerk *= 1.0 - kJerkForStop;
  }
  return limits;
}

}  // namespace

OptimalMotion::OptimalMotion(const PathGrid& grid, const std::vector<TimingLimits>& limits,
                             const std::vector<Caps>& caps, const std::vector<double>& middles,
                             const JerkLimitedKnots& given, double average)
    : grid_(grid), limits_(limitsWithStop(limits)), optimum_(limits_) {
  divide(given, average);
  if (isTooShort()) return;
  appendPieces(caps, middles);
  optimum_.begin(squares_);
}

// The pieces end at these times, and at the places of curves between the first and the last of
// them.
void OptimalMotion::divide(const JerkLimitedKnots& given, double average) {
  SampledSpeed speed = sampled(given, average);
  const std::vector<double>& distances = speed.distances();
  if (distances.empty()) return;
  double begin = 0.0;
  const auto append = [&](double end) {
    if (!(end > begin)) return;
    squares_.push_back(speed.squareAt((begin + end) / 2.0));
    ends_.push_back(end);
    begin = end;
  };
  std::size_t next = 0;
  double end = 0.0;
  for (std::size_t i = 0; i < grid_.size(); ++i) {
    end += grid_[i].length;
    for (; next < distances.size() && distances[next] < end; ++next) {
      const bool inside = next > 0 && next + 1 < distances.size();
      const double part = inside ? kShortPart * (distances[next + 1] - distances[next]) : 0.0;
      const bool close = distances[next] - begin < part || end - distances[next] < part;
      if (!close) append(distances[next]);
    }
    const bool inside = end > distances.front() && end < distances.back();
    const bool curved = i + 1 < grid_.size() && !(grid_[i].straight && grid_[i + 1].straight);
    if (inside && curved) append(end);
  }
  append(end);
}

void OptimalMotion::appendPieces(const std::vector<Caps>& caps,
                                 const std::vector<double>& middles) {
  const std::size_t axes = grid_.axes();
  std::vector<PathDerivatives> derivatives(2 * axes);  // at the begin and at the end of a piece
  std::size_t interval = 0;
  double from = 0.0;   // the begin of the piece
  double begin = 0.0;  // the begin of the interval
  for (const double to : ends_) {
    giveWayAt(interval);
    const double middle = (from + to) / 2.0;
    while (interval + 1 < grid_.size() && begin + grid_[interval].length < middle) {
      begin += grid_[interval++].length;
    }
    const double length = grid_[interval].length;
    // The first and the last piece may be longer than their interval.
    const double in_from = std::max(0.0, from - begin);
    const double in_to = std::min(length, to - begin);
    for (std::size_t j = 0; j < axes; ++j) {
      const AxisAlong along(grid_, interval, j, middles[interval * axes + j]);
      derivatives[j] = along.at(in_from);
      derivatives[axes + j] = along.at(in_to);
    }
    const double part = (middle - begin) / length;
    const double cap = caps[interval].begin + part * (caps[interval].end - caps[interval].begin);
    optimum_.append(to - from, cap, derivatives);
    from = to;
  }
}

bool OptimalMotion::isTooShort() const { return ends_.size() < kFewestPieces; }

bool OptimalMotion::solve() {
  if (isTooShort()) return false;
  optimum_.solve();
  return true;
}

std::vector<AveragedPart> OptimalMotion::parts() const {
  std::vector<AveragedPart> parts(optimum_.size() + 1);
  double time = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    AveragedPart& part = parts[i];
    part.time = time;
    part.distance = i == 0 ? 0.0 : ends_[i - 1];
    part.speed = std::sqrt(optimum_.square(i));
    part.acceleration = optimum_.acceleration(i);
    if (i == optimum_.size()) break;
    const double duration = optimum_.duration(i);
    part.jerk = (optimum_.acceleration(i + 1) - part.acceleration) / duration;
    time += duration;
  }
  return parts;
}

void OptimalMotion::tighten(double from, double to, const LimitUsage& usage) {
  const auto first = std::upper_bound(ends_.begin(), ends_.end(), from);
  for (auto end = first; end != ends_.end(); ++end) {
    optimum_.tighten(static_cast<std::size_t>(end - ends_.begin()), usage);
    if (*end >= to) break;
  }
}

}  // namespace stepdriver::motion
