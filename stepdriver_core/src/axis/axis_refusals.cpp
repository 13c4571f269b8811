#include <cmath>

#include "axis_impl.h"

namespace stepdriver::axis {
namespace {

// Longest way of one move: every count on it is exact in a double with a half.
constexpr double kFarthest = 1099511627776.0;  // 2^40

}  // namespace

void Axis::Impl::refuseUnlessOpen() const {
  if (!closed.empty()) refuse(closed);
}

void Axis::Impl::refuseWhileMoving(const std::string& what) {
  refuseUnlessOpen();
  if (homing != nullptr) refuse("busy: it is being homed; " + what + " at rest");
  if (moving()) refuse("busy: it moves; " + what + " at rest");
  refuseWhileHeld();
}

void Axis::Impl::refuseWhileHeld() const {
  if (held) refuse("held; resume or stop it first");
}

void Axis::Impl::refuseUnlessReadyToMove() {
  refuseUnlessReady();
  refuseWhileHeld();
}

void Axis::Impl::refuseUnlessReady() {
  refuseUnlessOpen();
  harvest();
  if (!fault.empty()) refuse("at fault: " + fault + "; call recover first");
  if (disabling || !enabled) refuse("disabled; enable it first");
  if (asleep) refuse("asleep; wake it first");
}

void Axis::Impl::refuseTooFast(double speed) const {
  if (speed <= maxSpeed() * (1.0 + 1e-12)) return;
  refuse("the velocity " + show(speed, "/s") + " is above the maximum " + show(maxSpeed(), "/s"));
}

void Axis::Impl::refuseBeyondLimits(double position, const std::string& what) const {
  // Half a step of tolerance: what rounds to the limit is at the limit.
  const double tolerance = 0.5 / stepsPerUnit();
  if (config.min_position && position < *config.min_position - tolerance) {
    refuse(what + " " + show(position) + " is below the soft limit min_position " +
           show(*config.min_position));
  }
  if (config.max_position && position > *config.max_position + tolerance) {
    refuse(what + " " + show(position) + " is above the soft limit max_position " +
           show(*config.max_position));
  }
  if (std::abs(countOf(position)) > kFarthest) {
    refuse(what + " " + show(position) + " is more than 2^40 steps away");
  }
}

void Axis::Impl::refuseIntoEndstop(std::int64_t steps) const {
  if (steps > 0 && endstopActive(axis_lines.endstop_max, config.endstop_max).value_or(false)) {
    refuse("the max endstop is active; it moves only towards min");
  }
  if (steps < 0 && endstopActive(axis_lines.endstop_min, config.endstop_min).value_or(false)) {
    refuse("the min endstop is active; it moves only towards max");
  }
}

std::optional<bool> Axis::Impl::endstopActive(int line,
                                              const std::optional<Endstop>& endstop) const {
  if (!endstop) return std::nullopt;
  return (readInput(line) != 0) == endstop->active_level;
}

}  // namespace stepdriver::axis
