#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/bench.h"

// Where axes were at any time, from the edges of STEP and DIR and nothing else.

namespace stepdriver::test {

/// A place that is known to within an error [microsteps].
struct KnownPlace {
  double place = 0.0;
  double error = 0.0;
};

/// A motor by its trace. It makes step k where it crosses k - 1/2, and between two crossings it
/// deviates from a straight line in time by at most a (t - t1) (t2 - t) / 2.
class TracedMotor {
 public:
  /// @param acceleration [steps/s^2] that the motor keeps to. @param start_speed [steps/s] by which
  ///   its speed may jump.
  /// @param play [microsteps] all of its backlash: the place is that of the joint
  TracedMotor(const sim::MemoryTrace& trace, const std::string& name, double acceleration,
              double start_speed, std::int64_t play = 0)
      : acceleration_(acceleration), start_speed_(start_speed), play_(play) {
    const int step = trace.pin(name, "step");
    const int dir = trace.pin(name, "dir");
    bool forward = trace.levels()[static_cast<std::size_t>(dir)];
    crossings_.push_back({std::numeric_limits<std::int64_t>::min(), 0.0, 0, 0, 0, false});
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      Crossing next = crossings_.back();
      next.time_ns = edge.time_ns;
      next.crossed = static_cast<double>(next.count) + (forward ? 0.5 : -0.5);
      next.count += forward ? 1 : -1;
      next.since_turn = forward == next.is_up ? next.since_turn + 1 : 1;
      next.is_up = forward;
      next.taken_up = std::clamp<std::int64_t>(next.taken_up + (forward ? 1 : -1), 0, play);
      crossings_.push_back(next);
    }
  }

  /// The place at a time [ns]. While the backlash is being taken up, or is left again before it
  /// was, the joint is known to within twice as much.
  KnownPlace at(double time_ns) const {
    const std::size_t before = lastUntil(time_ns);
    const Crossing& from = crossings_[before];
    const bool is_last = before + 1 == crossings_.size();
    KnownPlace known{static_cast<double>(from.count), 0.5};
    if (before > 0 && !is_last) {
      const Crossing& to = crossings_[before + 1];
      const double since = (time_ns - static_cast<double>(from.time_ns)) * 1e-9;
      const double left = (static_cast<double>(to.time_ns) - time_ns) * 1e-9;
      const double all = since + left;
      const double jumps = 2.0 * start_speed_ / all;
      known.place = from.crossed + (to.crossed - from.crossed) * since / all;
      known.error = std::min(1.0, (acceleration_ / 2.0 + jumps) * since * left);
    }
    if (play_ == 0) return known;
    // A path takes up the backlash while the joint moves on: for some way after a turn the joint
    // isn't yet where the steps alone would put it.
    const std::int64_t way = from.since_turn + (is_last ? 0 : 1);
    const bool is_settled =
        way > kTakenUpIn * play_ && (is_last || crossings_[before + 1].since_turn > 1);
    if (is_settled && from.is_up) known.place -= static_cast<double>(play_);
    if (is_settled) return known;
    known.place -= static_cast<double>(from.taken_up);
    known.error = 2.0 * static_cast<double>(play_);
    return known;
  }
  bool hasMovedBy(double time_ns) const { return lastUntil(time_ns) > 0; }

  /// The time of the step that is nearest to a time.
  std::int64_t stepNear(std::int64_t time_ns) const {
    const std::size_t before = lastUntil(static_cast<double>(time_ns));
    std::int64_t nearest = crossings_[before].time_ns;
    if (before + 1 < crossings_.size() &&
        (before == 0 || crossings_[before + 1].time_ns - time_ns < time_ns - nearest)) {
      nearest = crossings_[before + 1].time_ns;
    }
    return nearest;
  }

 private:
  struct Crossing {
    std::int64_t time_ns = 0;
    double crossed = 0.0;
    std::int64_t count = 0;  // after it
    std::int64_t taken_up = 0;
    std::int64_t since_turn = 0;  // steps in this direction
    bool is_up = false;
  };
  static constexpr std::int64_t kTakenUpIn = 40;

  std::size_t lastUntil(double time_ns) const {
    const auto after = std::upper_bound(crossings_.begin() + 1, crossings_.end(), time_ns,
                                        [](double time, const Crossing& crossing) {
                                          return time < static_cast<double>(crossing.time_ns);
                                        });
    return static_cast<std::size_t>(after - crossings_.begin()) - 1;
  }

  double acceleration_;
  double start_speed_;
  std::int64_t play_;
  std::vector<Crossing> crossings_;
};

/// Several axes by the trace of their motors, also if they share them. They begin at 0, and have
/// no endstop that stopped them.
class TracedAxes {
 public:
  TracedAxes(const sim::MemoryTrace& trace, const std::vector<config::AxisConfig>& axes) {
    const auto steps = [](const config::AxisConfig& axis, double units) {
      return units * axis.steps_per_unit;
    };
    const auto group = axes.front().kinematics;
    for (const config::AxisConfig& axis : axes) {
      double acceleration = steps(axis, std::max(axis.acceleration, axis.deceleration));
      if (axis.kinematics) {
        acceleration = 0.0;
        for (const config::AxisConfig& other : axes) {
          if (other.kinematics) acceleration += steps(other, other.acceleration);
        }
      }
      motors_.emplace_back(trace, axis.name, 1.02 * acceleration, steps(axis, axis.start_speed),
                           std::llround(steps(axis, axis.backlash)));
    }
    if (group) inverse_ = group->inverse;
  }

  /// The place of an axis at a time [ns]; axes that share motors are the first ones.
  KnownPlace at(std::size_t axis, double time_ns) const {
    if (axis >= inverse_.size()) return motors_[axis].at(time_ns);
    KnownPlace sum;
    for (std::size_t i = 0; i < inverse_.size(); ++i) {
      const KnownPlace motor = motors_[i].at(time_ns);
      sum.place += inverse_[axis][i] * motor.place;
      sum.error += std::abs(inverse_[axis][i]) * motor.error;
    }
    return sum;
  }
  bool hasMovedBy(std::int64_t time_ns) const {
    return std::any_of(motors_.begin(), motors_.end(), [&](const TracedMotor& motor) {
      return motor.hasMovedBy(static_cast<double>(time_ns));
    });
  }
  bool sharesMotors(std::size_t axis) const { return axis < inverse_.size(); }
  const TracedMotor& motor(std::size_t number) const { return motors_[number]; }

 private:
  std::vector<TracedMotor> motors_;
  config::Matrix inverse_;
};

}  // namespace stepdriver::test
