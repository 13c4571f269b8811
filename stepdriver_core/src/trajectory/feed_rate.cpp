#include "feed_rate.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "math/root_finding.h"
#include "point_to_point/phases.h"
#include "point_to_point/velocity_change.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoWay = 1e-12;  // [s]

// The motion that ends the current slope without leaving the rates from 0 to 1.
void level(Phases& phases, double jerk) {
  const double slope = phases.a().value();
  const double rate = phases.v().value();
  const double room = slope < 0.0 ? rate : 1.0 - rate;
  if (!(room > 0.0)) return phases.settle(phases.v(), 0.0);
  const double needed = slope * slope / (2.0 * room);
  const double by = std::max(jerk, needed);
  phases.run(std::copysign(by, -slope), std::abs(slope) / by);
  const double sign = std::copysign(1.0, slope);
  phases.settle(std::clamp(rate + sign * slope * slope / (2.0 * by), 0.0, 1.0), 0.0);
}

bool leavesRates(const Phases& phases, double jerk) {
  const double slope = phases.a().value();
  const double level = phases.v().value() + slope * std::abs(slope) / (2.0 * jerk);
  return level < 0.0 || level > 1.0;
}

Phases phasesOf(const MotionState& from, double rate, const FeedRateLimits& limits, double after) {
  const double slope = limits.jerk > 0.0 ? from.acceleration : 0.0;
  Phases phases(from.velocity, slope);
  if (slope != 0.0 && (after > 0.0 || leavesRates(phases, limits.jerk))) level(phases, limits.jerk);
  phases.run(0.0, after);
  changeVelocity(phases, rate, {0.0, 1.0, limits.slope, limits.slope, limits.jerk});
  return phases;
}

}  // namespace

Profile planFeedRate(std::int64_t start_ns, const MotionState& from, double rate,
                     const FeedRateLimits& limits, double after, DoubleDouble end) {
  const Phases phases = phasesOf(from, rate, limits, after);
  std::vector<Piece> pieces;
  DoubleDouble place = from.position;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    Phase phase = phases[i];
    const DoubleDouble left = end - place;
    const bool ends_here = left < phase.displacement;
    if (ends_here) {
      const auto short_of_it = [&](DoubleDouble t) {
        return left - advance(phase.v, phase.a, phase.j, t).displacement;
      };
      phase.duration = rootOf(short_of_it, phase.duration.value());
    }
    pieces.push_back(pieceOf(phase, place));
    place = ends_here ? end : place + phase.displacement;
    if (ends_here) break;
  }
  if (const DoubleDouble left = end - place; phases.v().hi > 0.0 && left.hi > kNoWay) {
    pieces.push_back({left / phases.v(), place, phases.v().hi, 0.0, 0.0, phases.v().lo});
  }
  if (pieces.empty()) return {start_ns, place};
  return {start_ns, std::move(pieces)};
}

}  // namespace stepdriver::motion
