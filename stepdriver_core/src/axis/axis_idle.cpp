#include <cmath>

#include "axis_impl.h"

namespace stepdriver::axis {

// While the axis moves it can't be idle for a whole time-out: that is when to look again.
pulse::Nanoseconds Axis::Impl::superviseIdle() {
  if (config.idle_timeout <= 0.0) return pulse::kNever;
  const bool moves = moving();
  const bool stays = idle || held || homing != nullptr || disabling || !enabled || asleep ||
                     !fault.empty() || !closed.empty();
  const auto timeout = static_cast<pulse::Nanoseconds>(std::llround(config.idle_timeout * 1e9));
  const pulse::Nanoseconds now = driver.clock().now();
  if (moves || stays) return now + timeout;
  if (now < rest_since + timeout) return rest_since + timeout;
  const bool sleeps = config.idle_action == IdleAction::kSleep;
  try {
    writePins(sleeps ? pins.sleep(true) : pins.enable(false));
  } catch (const GpioError&) {  // NOLINT(bugprone-empty-catch): it is the axis's fault from now on
    return now + timeout;
  }
  idle = true;
  noteUnpowered();
  if (sleeps) noteHome();
  return now + timeout;
}

void Axis::Impl::wake() {
  if (!idle) return;
  const bool sleeps = config.idle_action == IdleAction::kSleep;
  writePins(sleeps ? pins.sleep(false) : pins.enable(true));
  idle = false;
}

void Axis::Impl::noteUnpowered() {
  if (!config.holds_position_unpowered) position_valid = false;
}

// The translator has gone Home: with another phase there the motor turns when it has current again.
void Axis::Impl::noteHome() {
  const std::int64_t count = harvest().count;
  const std::int64_t cycle = static_cast<std::int64_t>(chip::kFullStepsPerCycle) * microsteps;
  if ((count - home_count) % cycle != 0) position_valid = false;
  home_count = count;
}

}  // namespace stepdriver::axis
