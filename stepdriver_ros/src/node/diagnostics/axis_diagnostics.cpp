#include "axis_diagnostics.h"

#include <fmt/format.h>

#include <string>

#include "common/place_text.h"
#include "common/text.h"

namespace stepdriver::ros_node {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using diagnostic_updater::DiagnosticStatusWrapper;

std::string doingOf(const axis::AxisState& state) {
  if (state.homing != axis::HomingPhase::kNone) {
    return std::string("is being homed: ") + axis::nameOf(state.homing);
  }
  if (state.held) return "on hold";
  if (state.moving) return "moves";
  if (state.idle) return "idle";
  if (state.asleep) return "asleep";
  return state.enabled ? "at rest" : "disabled";
}

void warnNearLimit(const config::AxisConfig& config, double position,
                   DiagnosticStatusWrapper& status) {
  const bool both = config.min_position && config.max_position;
  const double near = both ? (*config.max_position - *config.min_position) * kNearLimit
                           : 0.5 / config.steps_per_unit;
  const auto warn = [&](const char* which, double limit) {
    status.mergeSummary(DiagnosticStatus::WARN,
                        fmt::format("near the soft limit {}, {} {}", which, roundedText(limit),
                                    config::unitOf(config.kind)));
  };
  if (config.min_position && position <= *config.min_position + near) {
    warn("min_position", *config.min_position);
  }
  if (config.max_position && position >= *config.max_position - near) {
    warn("max_position", *config.max_position);
  }
}

void addValues(const config::AxisConfig& config, const AxisReading& reading,
               DiagnosticStatusWrapper& status) {
  const axis::AxisState& state = reading.state;
  const axis::AxisLimits& limits = reading.limits;
  const std::string unit = config::unitOf(config.kind);
  const auto add_switch = [&](const char* key, const std::optional<bool>& active) {
    status.add(key, active ? (*active ? "active" : "inactive") : "none");
  };
  const double scale = config.steps_per_unit * state.microsteps / config.microsteps;
  status.add("position [" + unit + "]", placeNumber(state.position, scale));
  status.add("velocity [" + unit + "/s]", roundedText(state.velocity));
  status.add("target [" + unit + "]", placeNumber(state.target, scale));
  status.add("enabled", state.enabled);
  status.add("homed", state.homed);
  status.add("position valid", state.position_valid);
  status.add("microsteps", state.microsteps);
  status.add("motor power", state.powered ? "there" : "off");
  if (config.brake) status.add("brake", state.brake_engaged ? "engaged" : "released");
  add_switch("min endstop", reading.endstops.min);
  add_switch("max endstop", reading.endstops.max);
  status.add("max_speed [" + unit + "/s]", limits.max_speed);
  status.add("acceleration [" + unit + "/s^2]", limits.acceleration);
  status.add("deceleration [" + unit + "/s^2]", limits.deceleration);
  status.add("jerk [" + unit + "/s^3]", limits.jerk);
}

// What the chips say that have a serial port.
void reportDrivers(const axis::AxisState& state, DiagnosticStatusWrapper& status) {
  if (!state.drivers) return;
  for (const driver::DriverState& driver : *state.drivers) {
    const std::string of = driver.motor.empty() ? "" : " of motor " + driver.motor;
    if (driver.temperature_warning) {
      status.mergeSummary(DiagnosticStatus::WARN,
                          "the driver" + of + " is hot, and will soon switch itself off");
    }
    status.add("driver" + of, driver.is_set_up ? "set up" : "not set up");
    status.add("run current" + of + " [A]", roundedText(driver.run_current));
    status.add("hold current" + of + " [A]", roundedText(driver.hold_current));
    status.add("present current" + of + " [A]", roundedText(driver.present_current));
    status.add("temperature" + of, driver.at_least_celsius > 0
                                       ? fmt::format("above {} C", driver.at_least_celsius)
                                       : "below 120 C");
    status.add("chopper" + of, driver.stealth_chop ? "StealthChop" : "SpreadCycle");
    status.add("open coils" + of, driver.open_load_a   ? driver.open_load_b ? "A and B" : "A"
                                  : driver.open_load_b ? "B"
                                                       : "none");
    status.add("SG_RESULT" + of,
               driver.stall_guard ? std::to_string(*driver.stall_guard) : "not measured");
    status.add("register accesses" + of, driver.transactions);
    status.add("register accesses tried again" + of, driver.retries);
  }
}

}  // namespace

void reportAxis(const config::AxisConfig& config, const AxisReading& reading,
                DiagnosticStatusWrapper& status) {
  const axis::AxisState& state = reading.state;
  status.summary(DiagnosticStatus::OK, doingOf(state));
  if (!state.fault.empty()) {
    status.mergeSummary(DiagnosticStatus::ERROR, state.fault + ": " + state.remedy);
  }
  if (!reading.endstop_error.empty()) {
    status.mergeSummary(DiagnosticStatus::ERROR, reading.endstop_error);
  }
  if (!state.stopped_by.empty()) {
    status.mergeSummary(DiagnosticStatus::WARN, "its last motion ended early: " + state.stopped_by);
  }
  if (!state.position_valid) {
    status.mergeSummary(DiagnosticStatus::WARN,
                        "the position is unverified" +
                            (state.position_note.empty() ? "" : " (" + state.position_note + ")") +
                            ": home it, or set its position");
  } else if (!state.position_note.empty()) {
    status.mergeSummary(DiagnosticStatus::WARN, state.position_note + ": home it");
  }
  if (reading.endstops.min.value_or(false)) {
    status.mergeSummary(DiagnosticStatus::WARN, "the min endstop is active");
  }
  if (reading.endstops.max.value_or(false)) {
    status.mergeSummary(DiagnosticStatus::WARN, "the max endstop is active");
  }
  warnNearLimit(config, state.position, status);
  addValues(config, reading, status);
  reportDrivers(state, status);
}

}  // namespace stepdriver::ros_node
