#include "path_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "stepdriver_core/error.h"

namespace stepdriver::motion {
namespace {

auto tied(const MotionLimits& limits) {
  return std::tie(limits.start_speed, limits.max_speed, limits.acceleration, limits.deceleration,
                  limits.jerk);
}

auto tied(const PathAxis& axis) {
  return std::tie(axis.name, axis.kind, axis.shares_motors, axis.microsteps, axis.steps_per_unit,
                  axis.origin, axis.continuous, axis.min_position, axis.max_position,
                  axis.configured_backlash, axis.backlash, axis.max_speed_source,
                  axis.min_position_source, axis.max_position_source);
}

}  // namespace

bool PathAxis::operator==(const PathAxis& other) const {
  return tied(*this) == tied(other) && tied(limits) == tied(other.limits) &&
         tied(stop_limits) == tied(other.stop_limits);
}

double PathAxis::mostAcceleration() const {
  return std::max(limits.acceleration, limits.deceleration);
}

std::string PathAxis::show(double value, const char* per) const {
  return fmt::format("{:.9g} {}{}", value, config::unitOf(kind), per);
}

std::string PathAxis::showPlace(double position) const {
  return config::placeText(position, kind, steps_per_unit);
}

std::string PathAxis::showLimit(double value, config::LimitSource source, const char* per) const {
  return fmt::format("{}, from {}", show(value, per), config::sourceText(source));
}

void PathAxis::refuse(const std::string& why) const { throw Refused(name + ": " + why); }

std::string PathAxis::whyBeyondLimits(double position, const std::string& what) const {
  if (isBelow(position)) {
    return fmt::format("{} {} is below the soft limit min_position {}", what, show(position),
                       showLimit(*min_position, min_position_source));
  }
  if (isAbove(position)) {
    return fmt::format("{} {} is above the soft limit max_position {}", what, show(position),
                       showLimit(*max_position, max_position_source));
  }
  if (isTooFar(position)) {
    return fmt::format("{} {} is more than 2^40 steps away", what, show(position));
  }
  return "";
}

void PathAxis::refuseBeyondLimits(double position, const std::string& what) const {
  if (const std::string why = whyBeyondLimits(position, what); !why.empty()) refuse(why);
}

}  // namespace stepdriver::motion
