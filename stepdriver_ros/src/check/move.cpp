#include "move.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/text.h"
#include "interrupt_watch.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::check {
namespace {

constexpr double kShortStroke = 1.0;  // [mm]
constexpr double kShortTurn = 10.0;   // [deg]

using ros_node::roundedText;
using Say = std::function<void(const std::string&)>;

std::string lengthText(const config::AxisConfig& axis, double length) {
  return roundedText(length * config::configUnitsPerUnit(axis.kind)) +
         (axis.kind == config::Kind::kLinear ? " mm" : " degrees");
}

double strokeOf(const config::AxisConfig& axis, const std::optional<double>& distance) {
  const double usual = axis.kind == config::Kind::kLinear ? kShortStroke : kShortTurn;
  return distance.value_or(usual) / config::configUnitsPerUnit(axis.kind);
}

/// Moves one axis. @return whether it is back where it was.
bool moveAxis(machine::Machine& machine, axis::Axis& axis, double stroke, const Say& say) {
  const config::AxisConfig& config = axis.config();
  const machine::EngineFigures before = machine.figures();
  axis.setPosition(startFor(config, stroke));
  if (config.hasSwitchedCurrent()) axis.enable(true);
  const double start = axis.state().position;
  const axis::MoveResult forth = axis.wait(axis.moveTo(stroke, true));
  say(fmt::format("  {}: out: {}", config.name, forth.message));
  bool reached = forth.end == axis::MoveEnd::kReached;
  // The way back leads away from an endstop that the axis met; after any other end it must not
  // move.
  if (reached || forth.end == axis::MoveEnd::kEndstopMin ||
      forth.end == axis::MoveEnd::kEndstopMax) {
    const axis::MoveResult back = axis.wait(axis.moveTo(start));
    say(fmt::format("  {}: back: {}", config.name, back.message));
    reached = reached && back.end == axis::MoveEnd::kReached;
  }
  const double off = axis.state().position - start;
  const machine::EngineFigures after = machine.figures();
  say(fmt::format(
      "  {}: {} pulses, {} slips, worst lateness so far {} us; {}", config.name,
      after.pulses - before.pulses, after.slips - before.slips,
      roundedText(after.worst_lateness * 1e6),
      off == 0.0 ? "back where it was" : lengthText(config, off) + " from where it was"));
  if (config.hasSwitchedCurrent()) axis.enable(false);
  return reached && off == 0.0;
}

}  // namespace

double startFor(const config::AxisConfig& axis, double stroke) {
  double start = 0.0;
  if (axis.max_position) start = std::min(start, *axis.max_position - std::max(stroke, 0.0));
  if (axis.min_position) start = std::max(start, *axis.min_position - std::min(stroke, 0.0));
  return start;
}

bool moveForthAndBack(const MoveOrder& order, gpio::Backend& backend, pulse::Clock& clock,
                      const Say& say) {
  std::vector<config::AxisConfig> axes = order.axes;
  for (config::AxisConfig& axis : axes) {
    axis.enable_on_start = false;
    axis.disable_on_shutdown = true;
    axis.require_homing = false;  // its stroke ends at its beginning
  }
  machine::MachineOptions options = order.machine;
  options.measure = false;
  options.state_file.clear();
  options.record_seconds = 0.0;
  machine::Machine machine(axes, backend, clock, options);
  InterruptWatch watch([&] {
    say("  interrupted: decelerating");
    try {
      machine.shutdown();
    } catch (const Error& error) {
      say(std::string("  ") + error.what());
    }
  });
  bool all_back = true;
  for (const auto& axis : machine.axes()) {
    if (!order.only.empty() && order.only != axis->config().name) continue;
    const double stroke = strokeOf(axis->config(), order.distance);
    try {
      all_back = moveAxis(machine, *axis, stroke, say) && all_back;
    } catch (const Refused& refused) {
      say(std::string("  ") + refused.what());
      if (!watch.interrupted() && axis->config().hasSwitchedCurrent()) axis->enable(false);
      all_back = false;
    }
  }
  return all_back && !watch.interrupted();
}

}  // namespace stepdriver::check
