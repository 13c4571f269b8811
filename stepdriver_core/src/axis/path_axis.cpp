#include "path_axis.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>

#include "stepdriver_core/error.h"

namespace stepdriver::axis {
namespace {

// Longest way of one move: every count on it is exact in a double with a half.
constexpr double kFarthest = 1099511627776.0;  // 2^40

auto tied(const motion::MotionLimits& limits) {
  return std::tie(limits.start_speed, limits.max_speed, limits.acceleration, limits.deceleration,
                  limits.jerk);
}

auto tied(const PathAxis& axis) {
  return std::tie(axis.name, axis.kind, axis.microsteps, axis.steps_per_unit, axis.origin,
                  axis.min_position, axis.max_position, axis.configured_backlash, axis.backlash,
                  axis.stop_deceleration, axis.stop_jerk);
}

}  // namespace

bool PathAxis::operator==(const PathAxis& other) const {
  return tied(*this) == tied(other) && tied(limits) == tied(other.limits);
}

double PathAxis::mostAcceleration() const {
  return std::max(limits.acceleration, limits.deceleration);
}

std::string PathAxis::show(double value, const char* per) const {
  char text[64];
  std::snprintf(text, sizeof(text), "%.9g %s%s", value, kind == config::Kind::kLinear ? "m" : "rad",
                per);
  return text;
}

void PathAxis::refuse(const std::string& why) const { throw Refused(name + ": " + why); }

void PathAxis::refuseBeyondLimits(double position, const std::string& what) const {
  // Half a step of tolerance: what rounds to the limit is at the limit.
  const double tolerance = 0.5 / steps_per_unit;
  if (min_position && position < *min_position - tolerance) {
    refuse(what + " " + show(position) + " is below the soft limit min_position " +
           show(*min_position));
  }
  if (max_position && position > *max_position + tolerance) {
    refuse(what + " " + show(position) + " is above the soft limit max_position " +
           show(*max_position));
  }
  if (std::abs(countOf(position)) > kFarthest) {
    refuse(what + " " + show(position) + " is more than 2^40 steps away");
  }
}

}  // namespace stepdriver::axis
