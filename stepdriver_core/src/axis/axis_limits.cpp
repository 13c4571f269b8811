#include <cmath>
#include <string>

#include "axis_impl.h"

namespace stepdriver::axis {

double Axis::Impl::checkedLimit(const char* what, double wanted, double configured,
                                const char* per) const {
  if (!std::isfinite(wanted) || wanted < 0.0) {
    refuse(std::string("the ") + what +
           " must be a finite number, above 0 or 0 for what is configured");
  }
  // Without a jerk limit in the configuration any is within it.
  if (configured > 0.0 && wanted > configured * (1.0 + 1e-12)) {
    refuse(std::string("the ") + what + " " + show(wanted, per) + " is above the configured " +
           show(configured, per));
  }
  return wanted > 0.0 ? wanted : configured;
}

void Axis::Impl::changeLimits(const AxisLimits& wanted) {
  refuseUnlessOpen();
  AxisLimits next;
  next.max_speed = checkedLimit("max_speed", wanted.max_speed, config.max_speed, "/s");
  next.acceleration =
      checkedLimit("acceleration", wanted.acceleration, config.acceleration, "/s^2");
  next.deceleration =
      checkedLimit("deceleration", wanted.deceleration, config.deceleration, "/s^2");
  next.jerk = checkedLimit("jerk", wanted.jerk, config.jerk, "/s^3");
  limits_next = next;
  limits_now.max_speed = next.max_speed;
  const Motion* current = underWay();
  if (current == nullptr || current->goal.slowsDown() || current->goal.course != nullptr) return;
  carryOut({{this, current->goal}});
}

}  // namespace stepdriver::axis
