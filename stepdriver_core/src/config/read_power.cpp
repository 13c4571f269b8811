#include "read_power.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "bounds.h"

namespace stepdriver::config {
namespace {

// By IdleAction.
const std::vector<std::string> kIdleActions = {"disable", "sleep", "lower_current"};

/// Each motor has a current for it, or none has.
void checkIdleCurrents(ConfigReader& axis, const AxisConfig& config) {
  const bool lowers = config.idle_action == IdleAction::kLowerCurrent;
  for (std::size_t i = 0; i < config.motors(); ++i) {
    const MotorConfig& motor = config.motorAt(i);
    const bool has = motor.tmc && motor.tmc->idle_current;
    ConfigReader reader =
        config.twins.empty() ? axis.map("tmc") : axis.map("motors").map(motor.motor).map("tmc");
    // One that is there, but wrong, was reported.
    if (has == lowers || reader.has("idle_current_a") == lowers) continue;
    const std::string key = reader.fullName("idle_current_a");
    axis.contradiction("idle_action",
                       fmt::format("is {}, but {} is {}", textOf(config.idle_action), key,
                                   lowers ? "missing" : "given, which is only for lower_current"));
  }
}

}  // namespace

std::string textOf(IdleAction action) { return kIdleActions.at(static_cast<std::size_t>(action)); }

void readPower(ConfigReader& axis, bool pins_are_right, AxisConfig& config) {
  config.enable_on_start = axis.boolean("enable_on_start", config.enable_on_start);
  config.disable_on_shutdown = axis.boolean("disable_on_shutdown", config.disable_on_shutdown);
  config.holds_position_unpowered =
      axis.boolean("holds_position_unpowered", config.holds_position_unpowered);
  config.idle_timeout = axis.number("idle_timeout_s", {0.0, kLongestTime}, config.idle_timeout);
  const std::string action = axis.oneOf("idle_action", kIdleActions, kIdleActions.front());
  const auto place = std::find(kIdleActions.begin(), kIdleActions.end(), action);
  config.idle_action = static_cast<IdleAction>(place - kIdleActions.begin());
  if (!pins_are_right) return;
  checkIdleCurrents(axis, config);
  if (config.idle_timeout <= 0.0 || config.idle_action == IdleAction::kLowerCurrent) return;
  const bool sleeps = config.idle_action == IdleAction::kSleep;
  if (sleeps ? config.pins.sleep.wired() : config.hasSwitchedCurrent()) return;
  const std::string pin = axis.fullName(sleeps ? "pins/sleep" : "pins/enable");
  axis.contradiction("idle_timeout_s",
                     fmt::format("is {}, but with idle_action {} that needs {}, which isn't wired",
                                 axis.shown("idle_timeout_s"), action, pin));
}

}  // namespace stepdriver::config
