#include "velocity_change.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {
namespace {

template <typename Real>
Real square(Real x) {
  return x * x;
}

// The state as seen in the direction of the change, so that the velocity always rises.
template <typename End>
class Mirrored {
 public:
  using Real = typename End::Real;

  Mirrored(End& phases, double sign) : phases_(phases), sign_(sign) {}

  double sign() const { return sign_; }
  Real v() const { return seen(phases_.v()); }
  Real a() const { return seen(phases_.a()); }
  void run(double j, Real duration) { phases_.run(sign_ * j, duration); }
  void settle(Real v, Real a) { phases_.settle(seen(v), seen(a)); }

 private:
  Real seen(Real value) const { return sign_ < 0.0 ? -value : value; }

  End& phases_;
  double sign_;
};

// Rises to the velocity `v_end` and the acceleration `a_end` >= 0 under one acceleration limit. An
// acceleration above the limit falls to it first; an `a_end` above it is possible only because the
// acceleration can't fall any faster.
template <typename End>
void rise(Mirrored<End> m, typename End::Real v_end, typename End::Real a_end, double limit,
          double jerk) {
  using Real = typename End::Real;
  const Real change = v_end - m.v();
  if (jerk == 0.0) {
    m.settle(m.v(), limit);
    m.run(0.0, change / limit);
    m.settle(v_end, 0.0);
    return;
  }
  const Real a = m.a();
  const Real top = std::max(Real(limit), a_end);
  // The point at which the line that rises from (v, a^2/2) meets the one that falls to (v_end,
  // a_end^2/2).
  const Real corner = half(square(a) + square(a_end)) + change * jerk;
  if (!(square(top) < corner)) {
    const Real peak = sqrt(corner);
    m.run(jerk, (peak - a) / jerk);
    m.run(-jerk, (peak - a_end) / jerk);
  } else {
    const Real up = abs(square(top) - square(a));
    const Real down = square(top) - square(a_end);
    m.run(a < top ? jerk : -jerk, abs(top - a) / jerk);
    m.settle(m.v(), top);
    m.run(0.0, (change - half(up + down) / jerk) / top);
    m.run(-jerk, (top - a_end) / jerk);
  }
  m.settle(v_end, a_end);
}

// Reduces an acceleration against the change to 0.
template <typename End>
void level(Mirrored<End> m, double jerk) {
  using Real = typename End::Real;
  if (jerk == 0.0 || !(m.a() < Real(0.0))) return;
  const Real duration = -m.a() / jerk;
  const Real v = m.v() + half(m.a() * duration);
  m.run(jerk, duration);
  m.settle(v, 0.0);
}

// The square of the acceleration that the fastest change may have at standstill, going from the
// state of the phases (a >= 0) to `v_end` > 0: all lines of the envelope at v = 0.
template <typename End>
typename End::Real squareAtStandstill(Mirrored<End> m, typename End::Real v_end,
                                      const MotionLimits& limits) {
  using Real = typename End::Real;
  const double j2 = 2.0 * limits.jerk;
  const Real limit(std::min(limits.acceleration, limits.deceleration));
  const Real highest = std::min(square(m.a()) - m.v() * j2, v_end * j2);
  const Real lowest = square(m.a()) + m.v() * j2;
  return std::max(std::min(highest, square(limit)), lowest);
}

// If the acceleration falls too fast to be 0 at the start speed, it still ends there, with the
// jump.
template <typename End>
bool dropToStartSpeed(Mirrored<End> m, double start, const MotionLimits& limits) {
  using Real = typename End::Real;
  const Real above = m.v() - start;
  if (limits.jerk == 0.0 || !(m.a() < Real(0.0))) return false;
  const Real root = square(m.a()) - above * (2.0 * limits.jerk);
  if (!(highOf(root) > kExact<Real> * limits.jerk * highOf(m.v()))) return false;
  m.run(limits.jerk, above * 2.0 / (sqrt(root) - m.a()));
  m.settle(start, 0.0);
  return true;
}

}  // namespace

template <typename End>
typename End::Real levelVelocity(const End& phases, const MotionLimits& limits) {
  if (limits.jerk == 0.0 || highOf(phases.a()) == 0.0) return phases.v();
  return phases.v() + half(phases.a() * abs(phases.a())) / limits.jerk;
}

template <typename End>
void changeVelocity(End& phases, typename End::Real velocity, const MotionLimits& limits) {
  using Real = typename End::Real;
  const Real at_level = levelVelocity(phases, limits);
  const double scale = std::max(std::abs(highOf(phases.v())), std::abs(highOf(at_level)));
  if (std::abs(highOf(velocity - at_level)) <= kExact<Real> * scale) {
    // The velocity is practically reached once the acceleration is 0.
    const double a = highOf(phases.a());
    if (a != 0.0) level(Mirrored<End>(phases, a > 0.0 ? -1.0 : 1.0), limits.jerk);
    phases.settle(velocity, 0.0);
    return;
  }
  Mirrored<End> m(phases, at_level < velocity ? 1.0 : -1.0);
  const Real goal = velocity * m.sign();
  level(m, limits.jerk);
  if (m.v() < Real(0.0) && Real(0.0) < goal) {
    const Real a = limits.jerk > 0.0 ? sqrt(squareAtStandstill(m, goal, limits)) : Real(0.0);
    rise(m, 0.0, a, limits.deceleration, limits.jerk);
  }
  const bool falls = m.v() < Real(0.0);
  rise(m, goal, 0.0, falls ? limits.deceleration : limits.acceleration, limits.jerk);
}

TurnRange turnRange(DoubleDouble v, DoubleDouble a, double sign, const MotionLimits& limits) {
  EndState<DoubleDouble> end(v, a);
  const Mirrored<EndState<DoubleDouble>> m(end, sign);
  level(m, limits.jerk);
  const DoubleDouble softest = square(m.a()) + m.v() * (2.0 * limits.jerk);
  return {sqrt(softest), sqrt(squareAtStandstill(m, DoubleDouble(limits.max_speed), limits))};
}

template <typename End>
void turn(End& phases, double sign, typename End::Real a_end, const MotionLimits& limits) {
  const Mirrored<End> m(phases, sign);
  level(m, limits.jerk);
  rise(m, 0.0, a_end, limits.deceleration, limits.jerk);
}

template <typename End>
void comeToRest(End& phases, const MotionLimits& limits) {
  using Real = typename End::Real;
  const double start = limits.start_speed;
  if (start == 0.0) return changeVelocity(phases, Real(0.0), limits);
  if (Real(start) < abs(phases.v())) {
    const double sign = highOf(phases.v()) > 0.0 ? 1.0 : -1.0;
    if (!dropToStartSpeed(Mirrored<End>(phases, sign), start, limits)) {
      changeVelocity(phases, Real(sign * start), limits);
    }
  }
  phases.settle(0.0, 0.0);
}

template <typename End>
void changeToMaximum(End& phases, double sign, const MotionLimits& limits) {
  using Real = typename End::Real;
  const double start = limits.start_speed;
  const double top = limits.max_speed;
  if (start > 0.0) {
    const bool ramps = Real(start) < abs(phases.v());
    const bool dropped = ramps && dropToStartSpeed(Mirrored<End>(phases, sign), start, limits);
    if (ramps && !dropped && top < start) changeVelocity(phases, Real(sign * start), limits);
    if (!ramps || top < start) phases.settle(sign * std::min(start, top), 0.0);
  }
  changeVelocity(phases, Real(sign * top), limits);
}

using Search = EndState<double>;
using Exact = EndState<DoubleDouble>;

template DoubleDouble levelVelocity(const Exact&, const MotionLimits&);
template void changeVelocity(Search&, double, const MotionLimits&);
template void changeVelocity(Phases&, DoubleDouble, const MotionLimits&);
template void turn(Search&, double, double, const MotionLimits&);
template void turn(Exact&, double, DoubleDouble, const MotionLimits&);
template void turn(Phases&, double, DoubleDouble, const MotionLimits&);
template void comeToRest(Exact&, const MotionLimits&);
template void comeToRest(Phases&, const MotionLimits&);
template void changeToMaximum(Phases&, double, const MotionLimits&);

}  // namespace stepdriver::motion
