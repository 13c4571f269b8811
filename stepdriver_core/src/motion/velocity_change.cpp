#include "velocity_change.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {
namespace {

const DoubleDouble kHalf(0.5);

DoubleDouble square(DoubleDouble x) { return x * x; }

// The state seen in the direction of the change, so that the velocity always rises.
struct Mirrored {
  Path& path;
  double sign;

  DoubleDouble v() const { return DoubleDouble(sign) * path.v(); }
  DoubleDouble a() const { return DoubleDouble(sign) * path.a(); }
  void run(double j, DoubleDouble duration) { path.run(sign * j, duration); }
  void settle(DoubleDouble v, DoubleDouble a) {
    path.settle(DoubleDouble(sign) * v, DoubleDouble(sign) * a);
  }
};

// Rises to the velocity `v_end` and the acceleration `a_end` >= 0 under one acceleration limit. An
// acceleration above the limit falls to it first; an `a_end` above it is possible only because the
// acceleration can't fall any faster.
void rise(Mirrored m, DoubleDouble v_end, DoubleDouble a_end, double limit, double jerk) {
  const DoubleDouble change = v_end - m.v();
  if (jerk == 0.0) {
    m.settle(m.v(), limit);
    m.run(0.0, change / DoubleDouble(limit));
    m.settle(v_end, 0.0);
    return;
  }
  const DoubleDouble j(jerk);
  const DoubleDouble a = m.a();
  const DoubleDouble top = std::max(DoubleDouble(limit), a_end);
  // The point at which the line that rises from (v, a^2/2) meets the one that falls to (v_end,
  // a_end^2/2).
  const DoubleDouble corner = (square(a) + square(a_end)) * kHalf + j * change;
  if (!(square(top) < corner)) {
    const DoubleDouble peak = sqrt(corner);
    m.run(jerk, (peak - a) / j);
    m.run(-jerk, (peak - a_end) / j);
  } else {
    const DoubleDouble up = abs(square(top) - square(a));
    const DoubleDouble down = square(top) - square(a_end);
    m.run(a < top ? jerk : -jerk, abs(top - a) / j);
    m.settle(m.v(), top);
    m.run(0.0, (change - (up + down) * kHalf / j) / top);
    m.run(-jerk, (top - a_end) / j);
  }
  m.settle(v_end, a_end);
}

// Reduces an acceleration against the change to 0.
void level(Mirrored m, double jerk) {
  if (jerk == 0.0 || !(m.a() < 0.0)) return;
  const DoubleDouble v = m.v() - square(m.a()) * kHalf / DoubleDouble(jerk);
  m.run(jerk, -m.a() / DoubleDouble(jerk));
  m.settle(v, 0.0);
}

// The square of the acceleration that the fastest change may have at standstill, going from the
// path's state (a >= 0) to `v_end` > 0: all lines of the envelope at v = 0.
DoubleDouble squareAtStandstill(Mirrored m, DoubleDouble v_end, const MotionLimits& limits) {
  const DoubleDouble j2(2.0 * limits.jerk);
  const DoubleDouble limit = std::min(limits.acceleration, limits.deceleration);
  const DoubleDouble highest = std::min(square(m.a()) - j2 * m.v(), j2 * v_end);
  const DoubleDouble lowest = square(m.a()) + j2 * m.v();
  return std::max(std::min(highest, square(limit)), lowest);
}

// If the acceleration falls too fast to be 0 at the start speed, it still ends there, with the
// jump.
bool dropToStartSpeed(Mirrored m, double start, const MotionLimits& limits) {
  const DoubleDouble above = m.v() - DoubleDouble(start);
  if (limits.jerk == 0.0 || !(m.a() < 0.0)) return false;
  const DoubleDouble root = square(m.a()) - DoubleDouble(2.0 * limits.jerk) * above;
  if (!(root.hi > kExact * limits.jerk * m.v().hi)) return false;
  m.run(limits.jerk, DoubleDouble(2.0) * above / (sqrt(root) - m.a()));
  m.settle(start, 0.0);
  return true;
}

}  // namespace

DoubleDouble levelVelocity(const Path& path, const MotionLimits& limits) {
  if (limits.jerk == 0.0) return path.v();
  return path.v() + path.a() * abs(path.a()) * kHalf / DoubleDouble(limits.jerk);
}

void changeVelocity(Path& path, DoubleDouble velocity, const MotionLimits& limits) {
  const DoubleDouble at_level = levelVelocity(path, limits);
  const DoubleDouble scale = std::max(abs(path.v()), abs(at_level));
  if (std::abs((velocity - at_level).hi) <= kExact * scale.hi) {
    // The velocity is practically reached once the acceleration is 0.
    if (path.a().hi != 0.0) level({path, path.a().hi > 0.0 ? -1.0 : 1.0}, limits.jerk);
    path.settle(velocity, 0.0);
    return;
  }
  Mirrored m{path, at_level < velocity ? 1.0 : -1.0};
  const DoubleDouble goal = DoubleDouble(m.sign) * velocity;
  level(m, limits.jerk);
  if (m.v() < 0.0 && DoubleDouble(0.0) < goal) {
    const DoubleDouble a =
        limits.jerk > 0.0 ? sqrt(squareAtStandstill(m, goal, limits)) : DoubleDouble(0.0);
    rise(m, 0.0, a, limits.deceleration, limits.jerk);
  }
  const bool falls = m.v() < 0.0;
  rise(m, goal, 0.0, falls ? limits.deceleration : limits.acceleration, limits.jerk);
}

TurnRange turnRange(const Path& path, double sign, const MotionLimits& limits) {
  Path at_level = path;
  const Mirrored m{at_level, sign};
  level(m, limits.jerk);
  const DoubleDouble softest = square(m.a()) + DoubleDouble(2.0 * limits.jerk) * m.v();
  return {sqrt(softest), sqrt(squareAtStandstill(m, limits.max_speed, limits))};
}

void turn(Path& path, double sign, DoubleDouble a_end, const MotionLimits& limits) {
  const Mirrored m{path, sign};
  level(m, limits.jerk);
  rise(m, 0.0, a_end, limits.deceleration, limits.jerk);
}

void comeToRest(Path& path, const MotionLimits& limits) {
  const double start = startSpeed(limits);
  if (start == 0.0) return changeVelocity(path, 0.0, limits);
  if (DoubleDouble(start) < abs(path.v())) {
    const double sign = path.v().hi > 0.0 ? 1.0 : -1.0;
    if (!dropToStartSpeed({path, sign}, start, limits)) {
      changeVelocity(path, sign * start, limits);
    }
  }
  path.settle(0.0, 0.0);
}

void changeToMaximum(Path& path, double sign, const MotionLimits& limits) {
  const double start = startSpeed(limits);
  if (start > 0.0) {
    if (!(DoubleDouble(start) < abs(path.v()))) path.settle(sign * start, 0.0);
    dropToStartSpeed({path, sign}, start, limits);
  }
  changeVelocity(path, sign * limits.max_speed, limits);
}

double startSpeed(const MotionLimits& limits) {
  return std::min(limits.start_speed, limits.max_speed);
}

}  // namespace stepdriver::motion
