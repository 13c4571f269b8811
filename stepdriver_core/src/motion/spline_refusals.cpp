#include "spline_refusals.h"

#include <cmath>
#include <cstdint>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

namespace stepdriver::motion {
namespace {

template <typename... Words>
std::string sentence(const Words&... words) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(17);
  (text << ... << words);
  return text.str();
}

template <typename... Words>
[[noreturn]] void refuse(const Words&... words) {
  throw std::invalid_argument(sentence(words...));
}

// "waypoint 3", or "the motion's start".
void requireFinite(const std::string& owner, const char* quantity, double value) {
  if (!std::isfinite(value)) {
    refuse("The ", quantity, " of ", owner, " is ", value, "; only finite numbers are allowed.");
  }
}

void requireNear(const std::string& owner, double position) {
  if (!(std::abs(position) <= kFarthest)) {
    refuse("The position of ", owner, " is ", position, " microsteps; allowed is from -", kFarthest,
           " to ", kFarthest, ".");
  }
}

void requireTime(const std::vector<Waypoint>& waypoints, std::size_t index) {
  const std::int64_t time = waypoints[index].time_ns;
  if (index == 0 && time < 0) {
    refuse("The time of waypoint 0 is ", time, " ns; it can't be before the start, 0.");
  }
  if (index > 0 && time <= waypoints[index - 1].time_ns) {
    refuse("The time of waypoint ", index, " is ", time, " ns; it must be at least 1 ns after the ",
           waypoints[index - 1].time_ns, " ns of the one before.");
  }
  constexpr auto kEnd = static_cast<std::int64_t>(Profile::kLongest * 1e9);
  if (time >= kEnd) {
    throw std::range_error(sentence("The time of waypoint ", index, " is ", time,
                                    " ns; it must be less than ", kEnd, " ns, some 126 years."));
  }
}

}  // namespace

void requirePlannable(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  requireStart(from);
  requireWaypoints(waypoints);
}

void requireStart(const MotionState& from) {
  const std::string start = "the motion's start";
  requireFinite(start, "position", from.position.value());
  requireNear(start, from.position.value());
  requireFinite(start, "velocity", from.velocity);
  requireFinite(start, "acceleration", from.acceleration);
}

void requireWaypoints(const std::vector<Waypoint>& waypoints) {
  if (waypoints.empty()) refuse("The trajectory has 0 waypoints; it needs at least 1.");
  for (std::size_t index = 0; index < waypoints.size(); ++index) {
    const Waypoint& waypoint = waypoints[index];
    const std::string owner = "waypoint " + std::to_string(index);
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
    refuse("The velocities and accelerations on the way to waypoint ", index, " lead up to ", reach,
           " microsteps away; allowed is ", kReach, ".");
  }
}

}  // namespace stepdriver::motion
