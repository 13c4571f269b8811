#include "values.h"

#include <pybind11/stl.h>

#include <optional>

namespace stepdriver::python {
namespace {

namespace py = pybind11;
using py::literals::operator""_a;

const char* nameOf(axis::MoveEnd end) {
  switch (end) {
    case axis::MoveEnd::kReached:
      return "reached";
    case axis::MoveEnd::kStopped:
      return "stopped";
    case axis::MoveEnd::kReplaced:
      return "replaced";
    case axis::MoveEnd::kEndstopMin:
      return "endstop_min";
    case axis::MoveEnd::kEndstopMax:
      return "endstop_max";
    case axis::MoveEnd::kEmergencyStop:
      return "emergency_stop";
    case axis::MoveEnd::kFault:
      return "fault";
    case axis::MoveEnd::kCompanion:
      return "companion";
  }
  return "";
}

const char* nameOf(axis::HomingEnd end) {
  switch (end) {
    case axis::HomingEnd::kHomed:
      return "homed";
    case axis::HomingEnd::kCancelled:
      return "cancelled";
    case axis::HomingEnd::kFailed:
      return "failed";
  }
  return "";
}

const char* nameOf(machine::ProbeEnd end) {
  switch (end) {
    case machine::ProbeEnd::kContact:
      return "contact";
    case machine::ProbeEnd::kNoContact:
      return "no_contact";
    case machine::ProbeEnd::kCancelled:
      return "cancelled";
    case machine::ProbeEnd::kFailed:
      return "failed";
  }
  return "";
}

// [s] On the clock of the machine.
std::optional<double> secondsOf(const std::optional<pulse::Nanoseconds>& time) {
  if (!time) return {};
  return static_cast<double>(*time) * 1e-9;
}

}  // namespace

namespace {

// The driver chips on a UART; empty: there is none.
py::tuple chipsOf(const axis::AxisState& state) {
  py::list chips;
  if (state.drivers != nullptr) {
    for (const driver::DriverState& chip : *state.drivers) {
      chips.append(py::dict(
          "motor"_a = chip.motor, "is_set_up"_a = chip.is_set_up,
          "run_current"_a = chip.run_current, "hold_current"_a = chip.hold_current,
          "present_current"_a = chip.present_current, "stealth_chop"_a = chip.stealth_chop,
          "at_least_celsius"_a = chip.at_least_celsius,
          "temperature_warning"_a = chip.temperature_warning, "stall_guard"_a = chip.stall_guard));
    }
  }
  return py::tuple(chips);
}

}  // namespace

py::dict valueOf(const axis::AxisState& state) {
  return py::dict(
      "enabled"_a = state.enabled, "asleep"_a = state.asleep, "powered"_a = state.powered,
      "brake_engaged"_a = state.brake_engaged, "idle"_a = state.idle, "moving"_a = state.moving,
      "held"_a = state.held, "homed"_a = state.homed, "homing"_a = axis::nameOf(state.homing),
      "position_valid"_a = state.position_valid, "microsteps"_a = state.microsteps,
      "speed_override"_a = state.speed_override, "position"_a = state.position,
      "planned"_a = state.planned, "velocity"_a = state.velocity, "slack"_a = state.slack,
      "skew"_a = state.skew, "target"_a = state.target, "time_left"_a = state.time_left,
      "fault"_a = state.fault, "remedy"_a = state.remedy, "stops"_a = state.stops,
      "stopped_by"_a = state.stopped_by, "position_note"_a = state.position_note,
      "chips"_a = chipsOf(state));
}

py::dict valueOf(const axis::AxisLimits& limits) {
  return py::dict("max_speed"_a = limits.max_speed, "acceleration"_a = limits.acceleration,
                  "deceleration"_a = limits.deceleration, "jerk"_a = limits.jerk);
}

py::dict valueOf(const axis::EndstopState& endstops) {
  return py::dict("min"_a = endstops.min, "max"_a = endstops.max);
}

py::dict valueOf(const axis::MoveResult& result) {
  return py::dict("end"_a = nameOf(result.end), "message"_a = result.message,
                  "position"_a = result.position, "duration"_a = result.duration);
}

py::dict valueOf(const axis::HomingResult& result) {
  return py::dict("axis"_a = result.axis, "end"_a = nameOf(result.end),
                  "message"_a = result.message, "position"_a = result.position,
                  "skew"_a = result.skew);
}

py::dict valueOf(const axis::MovePlan& plan) {
  py::list pieces;
  for (const axis::MovePiece& piece : plan.pieces) {
    pieces.append(py::make_tuple(piece.duration, piece.position, piece.velocity, piece.acceleration,
                                 piece.jerk));
  }
  py::list parts;
  for (const axis::MotionPart& part : plan.parts) {
    parts.append(py::make_tuple(part.part, part.delay));
  }
  return py::dict("target"_a = plan.move.target, "rest"_a = plan.move.rest,
                  "duration"_a = plan.move.duration, "overshoot"_a = plan.move.overshoot,
                  "steps_per_unit"_a = plan.steps_per_unit, "pieces"_a = pieces, "parts"_a = parts);
}

py::dict valueOf(const machine::CoordinatedResult& result) {
  return py::dict("end"_a = nameOf(result.end), "message"_a = result.message,
                  "positions"_a = result.positions, "duration"_a = result.duration);
}

py::dict valueOf(const motion::PathAhead& ahead) {
  return py::dict("segments"_a = ahead.segments, "room"_a = ahead.room, "time"_a = ahead.time,
                  "passed"_a = ahead.passed, "more_follows"_a = ahead.more_follows,
                  "targets"_a = ahead.targets);
}

py::dict valueOf(const machine::OutputState& output) {
  return py::dict("on"_a = output.on, "value"_a = output.value,
                  "changed"_a = secondsOf(output.changed), "note"_a = output.note,
                  "error"_a = output.error, "axis"_a = output.axis, "compared"_a = output.compared,
                  "missed"_a = output.missed);
}

py::dict valueOf(const machine::InputState& input) {
  return py::dict("active"_a = input.active, "changed"_a = secondsOf(input.changed),
                  "error"_a = input.error);
}

py::dict valueOf(const machine::LatchedEdge& edge) {
  py::dict positions;
  py::dict valid;
  for (const machine::LatchedAxis& axis : edge.axes) {
    positions[py::str(axis.name)] = axis.position;
    valid[py::str(axis.name)] = axis.position_valid;
  }
  return py::dict("number"_a = edge.number, "active"_a = edge.active,
                  "time"_a = static_cast<double>(edge.time) * 1e-9, "was_read"_a = edge.was_read,
                  "positions"_a = positions, "valid"_a = valid);
}

py::dict valueOf(const machine::LatchResult& result) {
  return py::dict("latched"_a = result.latched, "message"_a = result.message,
                  "edge"_a = valueOf(result.edge), "edges"_a = result.edges);
}

py::dict valueOf(const machine::ProbeResult& result) {
  return py::dict("end"_a = nameOf(result.end), "succeeded"_a = result.succeeded,
                  "message"_a = result.message, "contact"_a = result.contact,
                  "was_read"_a = result.was_read, "positions"_a = result.positions);
}

py::dict valueOf(const machine::EngineFigures& figures) {
  return py::dict("pulses"_a = figures.pulses, "slips"_a = figures.slips,
                  "slipped"_a = figures.slipped, "worst_lateness"_a = figures.worst_lateness,
                  "realtime"_a = figures.realtime);
}

py::dict valueOf(const sim::RigAxisReport& report) {
  py::dict violations;
  for (const auto& [violation, count] : report.violations) {
    violations[sim::nameOf(violation)] = count;
  }
  return py::dict("pulses_forward"_a = report.pulses_forward,
                  "pulses_backward"_a = report.pulses_backward, "carriage"_a = report.carriage,
                  "microsteps"_a = report.microsteps, "lost_steps"_a = report.lost_steps,
                  "energized"_a = report.energized, "min_pressed"_a = report.min_pressed,
                  "max_pressed"_a = report.max_pressed, "violations"_a = violations);
}

}  // namespace stepdriver::python
