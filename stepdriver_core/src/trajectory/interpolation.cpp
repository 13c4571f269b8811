#include "interpolation.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

// The velocity and the acceleration at a knot.
struct Derivatives {
  double velocity = 0.0;
  double acceleration = 0.0;
};

// The matrix {{vv, va}, {av, aa}} acts on derivatives.
struct Matrix {
  double vv = 0.0;
  double va = 0.0;
  double av = 0.0;
  double aa = 0.0;
};

Derivatives operator*(const Matrix& m, const Derivatives& d) {
  return {m.vv * d.velocity + m.va * d.acceleration, m.av * d.velocity + m.aa * d.acceleration};
}

Matrix operator*(const Matrix& a, const Matrix& b) {
  return {a.vv * b.vv + a.va * b.av, a.vv * b.va + a.va * b.aa, a.av * b.vv + a.aa * b.av,
          a.av * b.va + a.aa * b.aa};
}

Matrix operator-(const Matrix& a, const Matrix& b) {
  return {a.vv - b.vv, a.va - b.va, a.av - b.av, a.aa - b.aa};
}

Derivatives operator-(const Derivatives& a, const Derivatives& b) {
  return {a.velocity - b.velocity, a.acceleration - b.acceleration};
}

// All matrices below are positive definite.
Matrix inverse(const Matrix& m) {
  const double determinant = m.vv * m.aa - m.va * m.av;
  return {m.aa / determinant, -m.va / determinant, -m.av / determinant, m.vv / determinant};
}

// A condition on three neighbouring knots: before x- + own x + after x+ = right.
struct Condition {
  Matrix before;
  Matrix own;
  Matrix after;
  Derivatives right;
};

struct Span {
  double time = 0.0;  // [s]
  double way = 0.0;   // [microsteps]
};

Condition givenBy(const Derivatives& value) { return {{}, {1.0, 0.0, 0.0, 1.0}, {}, value}; }

// The acceleration at the end of one cubic is that at the beginning of the next. The unknown
// acceleration has a row of its own, so that both kinds of curves are solved alike.
Condition continuousAcceleration(const Span& left, const Span& right) {
  const double l = 1.0 / left.time;
  const double r = 1.0 / right.time;
  Condition condition;
  condition.before.vv = l;
  condition.own = {2.0 * (l + r), 0.0, 0.0, 1.0};
  condition.after.vv = r;
  condition.right.velocity = 3.0 * (left.way * l * l + right.way * r * r);
  return condition;
}

// First row: the fourth derivatives of two quintics are the same at their knot; second row: the
// third derivatives. Scaled so that the whole matrix is symmetric.
Condition continuousJerk(const Span& left, const Span& right) {
  const double l = 1.0 / left.time;
  const double r = 1.0 / right.time;
  const double l2 = l * l;
  const double r2 = r * r;
  Condition condition;
  condition.before = {168.0 * l2 * l, 24.0 * l2, -24.0 * l2, -3.0 * l};
  condition.own = {192.0 * (l2 * l + r2 * r), 36.0 * (r2 - l2), 36.0 * (r2 - l2), 9.0 * (l + r)};
  condition.after = {168.0 * r2 * r, -24.0 * r2, 24.0 * r2, -3.0 * r};
  condition.right = {360.0 * (left.way * l2 * l2 + right.way * r2 * r2),
                     60.0 * (right.way * r2 * r - left.way * l2 * l)};
  return condition;
}

// The knots of the curve are the start of the motion and the waypoints.
class KnotSequence {
 public:
  KnotSequence(const MotionState& from, const std::vector<Waypoint>& waypoints, std::size_t first)
      : from_(from), waypoints_(waypoints), first_(first) {}

  // The duration and the way of the segment that ends at a waypoint.
  Span spanTo(std::size_t index) const {
    const Waypoint& end = waypoints_[index];
    if (index == first_) {
      return {1e-9 * static_cast<double>(end.time_ns), (end.position - from_.position).value()};
    }
    const Waypoint& begin = waypoints_[index - 1];
    return {1e-9 * static_cast<double>(end.time_ns - begin.time_ns), end.position - begin.position};
  }

  Condition conditionAt(std::size_t index, Smoothness smoothness) const {
    const Waypoint& waypoint = waypoints_[index];
    if (waypoint.velocity) {
      return givenBy({*waypoint.velocity, waypoint.acceleration.value_or(0.0)});
    }
    if (index + 1 == waypoints_.size()) return givenBy({});
    const Span left = spanTo(index);
    const Span right = spanTo(index + 1);
    return smoothness == Smoothness::kJerk ? continuousJerk(left, right)
                                           : continuousAcceleration(left, right);
  }

 private:
  const MotionState& from_;
  const std::vector<Waypoint>& waypoints_;
  std::size_t first_;
};

}  // namespace

std::vector<Waypoint> interpolate(const MotionState& from, std::vector<Waypoint> waypoints,
                                  Smoothness smoothness) {
  const bool complete = std::all_of(waypoints.begin(), waypoints.end(),
                                    [](const Waypoint& each) { return each.velocity.has_value(); });
  if (complete) return waypoints;
  // The curve of planSpline() leads there.
  Waypoint& last = waypoints.back();
  if (!last.may_rest) last.position = static_cast<double>(restingCount(last.position));
  const std::size_t first = waypoints.size() > 1 && waypoints.front().time_ns == 0 ? 1 : 0;
  const KnotSequence knots(from, waypoints, first);
  // Gaussian elimination from the first knot to the last: x = value - next x+.
  std::vector<Derivatives> value(waypoints.size());
  std::vector<Matrix> next(waypoints.size());
  Derivatives value_before{from.velocity, from.acceleration};
  Matrix next_before;
  for (std::size_t i = first; i < waypoints.size(); ++i) {
    giveWayAt(i);
    const Condition condition = knots.conditionAt(i, smoothness);
    const Matrix pivot = inverse(condition.own - condition.before * next_before);
    value[i] = pivot * (condition.right - condition.before * value_before);
    next[i] = pivot * condition.after;
    value_before = value[i];
    next_before = next[i];
  }
  Derivatives solution;
  for (std::size_t i = waypoints.size(); i-- > first;) {
    solution = value[i] - next[i] * solution;
    if (waypoints[i].velocity) continue;
    waypoints[i].velocity = solution.velocity;
    waypoints[i].acceleration.reset();
    if (smoothness == Smoothness::kJerk) waypoints[i].acceleration = solution.acceleration;
  }
  return waypoints;
}

}  // namespace stepdriver::motion
