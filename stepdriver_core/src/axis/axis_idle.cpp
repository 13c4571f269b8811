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
    if (sleeps) {
      writePins(pins.sleep(true));
    } else {
      writeEnable(false);
    }
  } catch (const GpioError&) {  // NOLINT(bugprone-empty-catch): it is the axis's fault from now on
    return now + timeout;
  }
  idle = true;
  if (sleeps) {
    noteUnpowered();
    noteHome();
  }
  return now + timeout;
}

void Axis::Impl::wake() {
  if (!idle) return;
  if (config.idle_action == IdleAction::kSleep) {
    writePins(pins.sleep(false));
  } else {
    writeEnable(true);
  }
  idle = false;
}

// A line that another axis wants stays as it is, and this motor keeps its current.
void Axis::Impl::writeEnable(bool on) {
  EnableLine& line = *axis_lines.enable_line;
  if (on || !line.isWantedByOthers(on_enable_line_)) writePins(pins.enable(on));
  line.note(on_enable_line_, on);
  harvest();
}

void Axis::Impl::noteUnpowered() {
  if (!config.holds_position_unpowered) position_valid = false;
}

// The translator has gone Home: with another phase there the motor turns when it has current again.
void Axis::Impl::noteHome() {
  if (!isAtHome()) position_valid = false;
  home_count = harvest().count;
}

bool Axis::Impl::isAtHome() {
  const std::int64_t cycle = static_cast<std::int64_t>(chip::kFullStepsPerCycle) * microsteps;
  return (harvest().count - home_count) % cycle == 0;
}

}  // namespace stepdriver::axis
