#include "read_power.h"

#include <fmt/format.h>

#include "bounds.h"

namespace stepdriver::config {
void readPower(ConfigReader& axis, bool pins_are_right, AxisConfig& config) {
  config.enable_on_start = axis.boolean("enable_on_start", config.enable_on_start);
  config.disable_on_shutdown = axis.boolean("disable_on_shutdown", config.disable_on_shutdown);
  config.holds_position_unpowered =
      axis.boolean("holds_position_unpowered", config.holds_position_unpowered);
  config.idle_timeout = axis.number("idle_timeout_s", {0.0, kLongestTime}, config.idle_timeout);
  const std::string action = axis.oneOf("idle_action", {"disable", "sleep"}, "disable");
  config.idle_action = action == "sleep" ? IdleAction::kSleep : IdleAction::kDisable;
  if (!pins_are_right || config.idle_timeout <= 0.0) return;
  const bool sleeps = config.idle_action == IdleAction::kSleep;
  if ((sleeps ? config.pins.sleep : config.pins.enable).wired()) return;
  const std::string pin = axis.fullName(sleeps ? "pins/sleep" : "pins/enable");
  axis.contradiction("idle_timeout_s",
                     fmt::format("is {}, but with idle_action {} that needs {}, which isn't wired",
                                 axis.shown("idle_timeout_s"), action, pin));
}

}  // namespace stepdriver::config
