#include "motion_builder.h"

#include <algorithm>
#include <cmath>

#include "root.h"
#include "velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kForever = 3.0e9;        // s, 95 years
constexpr double kFarthest = 1.15292e18;  // microsteps, 2^60: fits into a Split, with room

constexpr double kRounding = 1e-15;  // relative, of a state's doubles

}  // namespace

MotionBuilder::MotionBuilder(const MotionState& from, const MotionLimits& limits)
    : position_(from.position), v_(from.velocity), a_(from.acceleration) {
  const double start = startSpeed(limits);
  const bool may_rest = start > 0.0 && std::abs(from.velocity) <= start;
  if (limits.jerk == 0.0 || may_rest) a_ = 0.0;
  unround(limits);
}

void MotionBuilder::unround(const MotionLimits& limits) {
  if (limits.jerk == 0.0) return;
  const DoubleDouble level = levelVelocity({v_, a_}, limits);
  const double scale = std::max(std::abs(v_.hi), std::abs(level.hi));
  for (const double speed : {0.0, startSpeed(limits), limits.max_speed}) {
    const DoubleDouble off = DoubleDouble(std::copysign(speed, level.hi)) - level;
    if (std::abs(off.hi) > kRounding * scale) continue;
    v_ = v_ + off;
    return;
  }
}

void MotionBuilder::moveTo(std::int64_t target, const MotionLimits& limits) {
  unround(limits);
  const DoubleDouble end = fromInteger(target);
  add(approach(v_, a_, end - position_, limits), end);
}

bool MotionBuilder::turnAt(std::int64_t target, double sign, const MotionLimits& limits) {
  unround(limits);
  const DoubleDouble end = fromInteger(target);
  const auto turned = [&](DoubleDouble a_end) {
    Path path(v_, a_);
    turn(path, sign, a_end, limits);
    return path;
  };
  // The distance of the turning point beyond the target.
  const auto beyond = [&](DoubleDouble a_end) {
    return DoubleDouble(-sign) * (position_ + turned(a_end).length() - end);
  };
  const TurnRange range = turnRange(Path(v_, a_), sign, limits);
  if (!(beyond(range.hardest).hi <= stopFrom(v_, a_, limits).doubt)) return false;
  DoubleDouble a_end = range.hardest;
  if (beyond(range.hardest).hi < 0.0 && beyond(range.softest).hi > 0.0) {
    const auto from_softest = [&](DoubleDouble more) { return beyond(range.softest + more); };
    a_end = range.softest + rootOf(from_softest, (range.hardest - range.softest).hi);
  }
  const Path path = turned(a_end);
  add({path, path.size()}, end);
  return true;
}

void MotionBuilder::moveOn(double sign, const MotionLimits& limits) {
  unround(limits);
  Path path(v_, a_);
  changeToMaximum(path, sign, limits);
  path.run(0.0, std::min(kForever, kFarthest / limits.max_speed));
  add({path, path.size()}, position_ + path.length());
}

double MotionBuilder::heading(const MotionLimits& limits) const {
  const bool turns_at_rest = startSpeed(limits) > 0.0;
  const double level = turns_at_rest ? v_.hi : levelVelocity({v_, a_}, limits).hi;
  return level < 0.0 || (level == 0.0 && v_.hi < 0.0) ? -1.0 : 1.0;
}

std::int64_t MotionBuilder::nextRest(const MotionLimits& limits) const {
  const Stop stop = stopFrom(v_, a_, limits);
  const double sign = heading(limits);
  const Split rest = split(position_ + stop.length);
  const bool short_of_it = sign * rest.rest > stop.doubt;
  return rest.whole + (short_of_it ? static_cast<std::int64_t>(sign) : 0);
}

void MotionBuilder::add(const Approach& part, DoubleDouble end) {
  const Path& path = part.path;
  const auto take = [this](const Phase& phase, DoubleDouble position) {
    pieces_.push_back(pieceOf(phase, position));
  };
  for (std::size_t i = 0; i < part.first_part; ++i) {
    take(path[i], position_);
    position_ = position_ + wayOf(path[i], path[i].duration);
  }
  DoubleDouble left;
  for (std::size_t i = part.first_part; i < path.size(); ++i) {
    left = left + wayOf(path[i], path[i].duration);
  }
  for (std::size_t i = part.first_part; i < path.size(); ++i) {
    take(path[i], end - left);
    left = left - wayOf(path[i], path[i].duration);
  }
  position_ = end;
  v_ = path.v();
  a_ = path.a();
}

Profile MotionBuilder::profile(std::int64_t start_ns) const {
  if (pieces_.empty()) return {start_ns, position_};
  return {start_ns, pieces_};
}

}  // namespace stepdriver::motion
