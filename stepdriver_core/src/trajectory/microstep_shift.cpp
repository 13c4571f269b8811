#include "microstep_shift.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "give_way.h"

namespace stepdriver::motion {
namespace {

// The part of a limit that a shift may add to an acceleration or a jerk: a tenth of the tolerance
// of trajectories.
constexpr double kShareOfShift = 1e-3;
constexpr double kLargestShift = 0.5;  // [microsteps]

double secondsOf(const Waypoint& waypoint) { return 1e-9 * static_cast<double>(waypoint.time_ns); }

// A shift that grows from 0 to its whole value within a time, from rest to rest.
class GrowingShift {
 public:
  GrowingShift(double whole, double begin, double time)
      : whole_(whole), begin_(begin), time_(time) {}

  void addTo(Waypoint& waypoint) const {
    const double u = std::clamp((secondsOf(waypoint) - begin_) / time_, 0.0, 1.0);
    const double v = 1.0 - u;
    waypoint.position += whole_ * u * u * u * (1.0 + 3.0 * v * (1.0 + 2.0 * v));
    if (waypoint.velocity) *waypoint.velocity += whole_ * 30.0 * u * u * v * v / time_;
    if (waypoint.acceleration) {
      *waypoint.acceleration += whole_ * 60.0 * u * v * (v - u) / (time_ * time_);
    }
  }

 private:
  double whole_;  // [microsteps]
  double begin_;  // [s]
  double time_;   // [s]
};

// [microsteps] How far the place of the axis is from the first of several waypoints, if that is
// meant to be the same place.
double shiftAtBegin(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  const Waypoint& first = waypoints.front();
  const bool rests = from.velocity == 0.0 && from.acceleration == 0.0;
  if (waypoints.size() == 1 || first.time_ns > 0 || !rests) return 0.0;
  const double shift = (from.position - first.position).value();
  return std::abs(shift) <= kLargestShift ? shift : 0.0;
}

}  // namespace

std::vector<Waypoint> shiftedToMicrosteps(const MotionState& from, std::vector<Waypoint> waypoints,
                                          double acceleration, double jerk) {
  const double duration = secondsOf(waypoints.back());
  double time = std::sqrt(5.8 * kLargestShift / (kShareOfShift * acceleration));
  if (jerk > 0.0) {
    time = std::max(time, std::cbrt(60.0 * kLargestShift / (kShareOfShift * jerk)));
  }
  time = std::min(time, duration);
  const double last = waypoints.back().position;
  const double rest = waypoints.back().may_rest ? last : static_cast<double>(restingCount(last));
  const double at_begin = shiftAtBegin(from, waypoints);
  const GrowingShift back(-at_begin, 0.0, time);
  const GrowingShift away(rest - last, duration - time, time);
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    giveWayAt(i);
    waypoints[i].position += at_begin;
    back.addTo(waypoints[i]);
    away.addTo(waypoints[i]);
  }
  waypoints.back().position = rest;
  return waypoints;
}

}  // namespace stepdriver::motion
