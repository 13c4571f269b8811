#include "motion_builder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "end_state.h"
#include "math/root_finding.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kForever = 3.0e9;  // [s] 95 years
// [microsteps] 2^60: it fits into a Split, with room to spare.
constexpr double kFarthestJog = 1.15292e18;

constexpr double kRounding = 1e-15;  // the rounding of the doubles of a state, relative to them

}  // namespace

MotionBuilder::MotionBuilder(const MotionState& from, const MotionLimits& limits)
    : position_(from.position), v_(from.velocity), a_(from.acceleration) {
  const double start = limits.start_speed;
  const bool may_rest = start > 0.0 && std::abs(from.velocity) <= start;
  if (limits.jerk == 0.0 || may_rest) a_ = 0.0;
  unround(limits);
}

void MotionBuilder::unround(const MotionLimits& limits) {
  if (limits.jerk == 0.0) return;
  const DoubleDouble level = levelVelocity(EndState<DoubleDouble>(v_, a_), limits);
  const double scale = std::max(std::abs(v_.hi), std::abs(level.hi));
  for (const double speed : {0.0, limits.start_speed, limits.max_speed}) {
    const DoubleDouble off = DoubleDouble(std::copysign(speed, level.hi)) - level;
    if (std::abs(off.hi) > kRounding * scale) continue;
    v_ = v_ + off;
    return;
  }
}

void MotionBuilder::moveTo(std::int64_t target, const MotionLimits& limits) {
  unround(limits);
  moveTo(target, Stop(v_, a_, limits), limits);
}

void MotionBuilder::moveTo(std::int64_t target, const Stop& stop, const MotionLimits& limits) {
  const DoubleDouble end = fromInteger(target);
  add(approach(v_, a_, end - position_, stop, limits), end);
}

bool MotionBuilder::turnAt(std::int64_t target, double sign, const MotionLimits& limits) {
  unround(limits);
  const DoubleDouble end = fromInteger(target);
  // The distance of the turning point beyond the target.
  const auto beyond = [&](auto a_end) {
    using Real = decltype(a_end);
    EndState<Real> turned(numberOf<Real>(v_), numberOf<Real>(a_));
    turn(turned, sign, a_end, limits);
    return Real(-sign) * (turned.length() - numberOf<Real>(end - position_));
  };
  const TurnRange range = turnRange(v_, a_, sign, limits);
  const double least = beyond(range.hardest).hi;
  if (!(least <= 0.0 || Stop(v_, a_, limits).meets(least))) return false;
  DoubleDouble a_end = range.hardest;
  const double most = beyond(range.softest).hi;
  if (least < 0.0 && most > 0.0) {
    const auto from_softest = [&](auto more) {
      return beyond(numberOf<decltype(more)>(range.softest) + more);
    };
    const double noise = 1e-15 * std::abs((end - position_).hi);
    const Bracket bracket{0.0, (range.hardest - range.softest).hi, most, least};
    a_end = range.softest + rootOf(from_softest, from_softest, bracket, noise);
  }
  Phases phases(v_, a_);
  turn(phases, sign, a_end, limits);
  add({phases, phases.size()}, end);
  return true;
}

void MotionBuilder::moveOn(double sign, const MotionLimits& limits) {
  unround(limits);
  Phases phases(v_, a_);
  changeToMaximum(phases, sign, limits);
  phases.run(0.0, std::min(kForever, kFarthestJog / limits.max_speed));
  add({phases, phases.size()}, position_ + phases.length());
}

double MotionBuilder::heading(const MotionLimits& limits) const {
  const bool turns_at_rest = limits.start_speed > 0.0;
  const double level =
      turns_at_rest ? v_.hi : levelVelocity(EndState<DoubleDouble>(v_, a_), limits).hi;
  return level < 0.0 || (level == 0.0 && v_.hi < 0.0) ? -1.0 : 1.0;
}

std::int64_t MotionBuilder::nextRest(const MotionLimits& limits) const {
  const Stop stop(v_, a_, limits);
  const double sign = heading(limits);
  const Split rest = split(position_ + stop.length());
  const bool short_of_it = sign * rest.rest > 0.0 && !stop.meets(rest.rest);
  return rest.whole + (short_of_it ? static_cast<std::int64_t>(sign) : 0);
}

void MotionBuilder::add(const Approach& part, DoubleDouble end) {
  const Phases& phases = part.phases;
  pieces_.reserve(pieces_.size() + phases.size());
  DoubleDouble left;  // the remaining distance of the second part
  for (std::size_t i = part.first_part; i < phases.size(); ++i)
    left = left + phases[i].displacement;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    const bool first = i < part.first_part;
    pieces_.push_back(pieceOf(phases[i], first ? position_ : end - left));
    if (first) {
      position_ = position_ + phases[i].displacement;
    } else {
      left = left - phases[i].displacement;
    }
  }
  position_ = end;
  v_ = phases.v();
  a_ = phases.a();
}

Profile MotionBuilder::profile(std::int64_t start_ns) {
  if (pieces_.empty()) return {start_ns, position_};
  return {start_ns, std::move(pieces_)};
}

}  // namespace stepdriver::motion
