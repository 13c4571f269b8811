#include "spline_checks.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "give_way.h"
#include "profile/errors.h"

namespace stepdriver::motion {
namespace {

[[noreturn]] void refuse(const std::string& why) { throw Malformed(why); }

[[noreturn]] void refuseNumber(const std::string& owner, const char* quantity, double value) {
  refuse(
      fmt::format("The {} of {} is {}; only finite numbers are allowed.", quantity, owner, value));
}

// An owner is a function that returns a name, "waypoint 3" or "the motion's start", for a refusal.
template <typename Owner>
void requireFinite(const Owner& owner, const char* quantity, double value) {
  if (!std::isfinite(value)) refuseNumber(owner(), quantity, value);
}

template <typename Owner>
void requireNear(const Owner& owner, double position) {
  if (!(std::abs(position) <= kFarthest)) {
    refuse(fmt::format(
        "The position of {0} is {1:.17g} microsteps; allowed is from -{2:.17g} to {2:.17g}.",
        owner(), position, kFarthest));
  }
}

std::string waypointText(std::size_t index) { return fmt::format("waypoint {}", index); }

void requireTime(const std::vector<Waypoint>& waypoints, std::size_t index) {
  const std::int64_t time = waypoints[index].time_ns;
  if (index == 0 && time < 0) {
    refuse(fmt::format("The time of waypoint 0 is {} ns; it can't be before the start, 0.", time));
  }
  if (index > 0 && time <= waypoints[index - 1].time_ns) {
    refuse(
        fmt::format("The time of waypoint {} is {} ns; it must be at least 1 ns after the {} ns of "
                    "the one before.",
                    index, time, waypoints[index - 1].time_ns));
  }
  constexpr auto kEnd = static_cast<std::int64_t>(Profile::kLongest * 1e9);
  if (time >= kEnd) {
    throw TooLong(
        fmt::format("The time of waypoint {} is {} ns; it must be less than {} ns, some 126 years.",
                    index, time, kEnd));
  }
}

}  // namespace

void requirePlannable(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  requireStart(from);
  requireWaypoints(waypoints);
}

void requireStart(const MotionState& from) {
  const auto start = [] { return std::string("the motion's start"); };
  requireFinite(start, "position", from.position.value());
  requireNear(start, from.position.value());
  requireFinite(start, "velocity", from.velocity);
  requireFinite(start, "acceleration", from.acceleration);
}

void requireWaypoints(const std::vector<Waypoint>& waypoints) {
  if (waypoints.empty()) refuse("The trajectory has 0 waypoints; it needs at least 1.");
  for (std::size_t index = 0; index < waypoints.size(); ++index) {
    const Waypoint& waypoint = waypoints[index];
    giveWayAt(index);
    const auto owner = [index] { return waypointText(index); };
    requireTime(waypoints, index);
    requireFinite(owner, "position", waypoint.position);
    requireNear(owner, waypoint.position);
    requireFinite(owner, "velocity", waypoint.velocity.value_or(0.0));
    requireFinite(owner, "acceleration", waypoint.acceleration.value_or(0.0));
  }
  if (waypoints.back().time_ns == 0) {
    refuse("The time of waypoint 0, the only one, is 0 ns; it must be at least 1 ns.");
  }
}

void requireReach(double reach, std::size_t index) {
  constexpr double kReach = 9007199254740992.0;  // 2^53
  if (!(reach <= kReach)) {
    refuse(
        fmt::format("The velocities and accelerations on the way to waypoint {} lead up to {:.6g} "
                    "microsteps away; allowed is {:.0f}.",
                    index, reach, kReach));
  }
}

}  // namespace stepdriver::motion
