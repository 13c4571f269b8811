#include "axis_impl.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "course.h"

namespace stepdriver::axis {
namespace {

constexpr const char* kChipFault =
    "the driver chip reports over-current or over-temperature on nFAULT";
constexpr const char* kChipRemedy =
    "let it cool down, check the motor's wiring and the current that is set, then call recover";
constexpr const char* kLateRemedy =
    "lower the axis's speed or the machine's load (stepdriver_check tells what it holds), call "
    "recover, and home it or set its position";

}  // namespace

Axis::Impl::Impl(AxisConfig axis_config, int engine_channel, const AxisLines& own_lines,
                 gpio::Lines& all_lines, EdgeLog& all_edges, pulse::PulseDriver& pulse_driver,
                 std::mutex& all_mutex)
    : config(std::move(axis_config)),
      chip(chip::chipOf(config.driver)),
      axis_lines(own_lines),
      pins(config, own_lines),
      lines(all_lines),
      edges(all_edges),
      driver(pulse_driver),
      channel(engine_channel),
      mutex(all_mutex),
      enabled(!pins.hasEnable()),
      microsteps(config.microsteps),
      limits_now{config.max_speed, config.acceleration, config.deceleration, config.jerk},
      limits_next(limits_now) {
  if (pins.hasEnable()) on_enable_line_ = axis_lines.enable_line->join();
}

// ---- what the engine has done ----

pulse::ChannelState Axis::Impl::harvest() {
  const pulse::ChannelState state = driver.engine().channel(channel);
  if (state.line_errors != line_errors_seen_) {
    line_errors_seen_ = state.line_errors;
    latch(failureText(state.failure), "then call recover");
    position_valid = false;
    pins_doubtful_ = true;
  }
  if (state.chip_faults != chip_faults_seen_) {
    chip_faults_seen_ = state.chip_faults;
    if (!isAsleep()) {
      latch(kChipFault, kChipRemedy);
      position_valid = false;
    }
  }
  if (pins.hasEnable() && axis_lines.enable_line->releases() != releases_seen_) {
    releases_seen_ = axis_lines.enable_line->releases();
    noteUnpowered();
  }
  // Read after the state: what the input has ended is known to be its doing.
  if (const std::uint64_t stops = driver.engine().inputStops(); stops != input_stops_seen_) {
    input_stops_seen_ = stops;
    latchEmergencyStop(kEmergencyStopInput);
  }
  if (state.ended != ended_seen_) {
    ended_seen_ = state.ended;
    rest_since = std::min(driver.clock().now(), state.end_time + driver.engine().state().slipped);
    conclude(state);
  }
  if (!position_valid) homed = false;
  if (state.following == 0) limits_now = limits_next;
  log.dropBefore(state.following != 0 ? state.following : state.ended);
  if (held && !fault.empty()) {
    dropHeld(fault == kEmergencyStopInput ? MoveEnd::kEmergencyStop : MoveEnd::kFault, fault);
  }
  return state;
}

void Axis::Impl::conclude(const pulse::ChannelState& state) {
  switch (state.end) {
    case pulse::EndReason::kEmergencyStop:
      latchEmergencyStop(kEmergencyStop);
      break;
    case pulse::EndReason::kTooLate:
      latch("a pulse was " + inMilliseconds(state.end_lateness) +
                " late, more than the motor can go on from at this speed",
            kLateRemedy);
      position_valid = false;
      break;
    default:
      break;
  }
  if (state.end_abrupt && state.end != pulse::EndReason::kDone) position_valid = false;
  const Motion* motion = log.find(state.ended);
  if (motion == nullptr || log.result(motion->goal.move)) return;
  if (state.end != pulse::EndReason::kDone) {
    held.reset();
  } else if (motion->goal.held) {
    return;  // it goes on later
  }
  log.conclude(motion->goal.move, resultOf(*motion, state));
}

void Axis::Impl::latch(const std::string& what, const std::string& what_to_do) {
  fault = what;
  remedy = what_to_do;
}

// By the input it is known to be the input's.
void Axis::Impl::latchEmergencyStop(const char* which) {
  if (fault == kEmergencyStopInput) return;
  latch(which, which == kEmergencyStopInput ? "release the button, then call recover"
                                            : "call recover when all is safe");
}

MoveResult Axis::Impl::resultOf(const Motion& motion, const pulse::ChannelState& state) {
  MoveResult result;
  result.position = positionOf(static_cast<double>(state.count - state.slack));
  result.duration = std::max(0.0, static_cast<double>(state.end_time - motion.begin_ns) * 1e-9);
  std::string why;
  switch (state.end) {
    case pulse::EndReason::kDone:
      result.end = motion.goal.stops() ? MoveEnd::kStopped : MoveEnd::kReached;
      why = motion.goal.stopped_by;
      break;
    case pulse::EndReason::kEndstopMin:
      result.end = MoveEnd::kEndstopMin;
      why = "the min endstop was met";
      break;
    case pulse::EndReason::kEndstopMax:
      result.end = MoveEnd::kEndstopMax;
      why = "the max endstop was met";
      break;
    case pulse::EndReason::kEmergencyStop:
      result.end = MoveEnd::kEmergencyStop;
      why = fault;
      break;
    case pulse::EndReason::kChipFault:
    case pulse::EndReason::kTooLate:
    case pulse::EndReason::kLineError:
      result.end = MoveEnd::kFault;
      why = fault;
      break;
    case pulse::EndReason::kCompanion:
      result.end = MoveEnd::kCompanion;
      why = endedWith(motion.goal);
      break;
  }
  if (result.end == MoveEnd::kReached) {
    result.message = config.name + " reached " + show(result.position);
  } else {
    result.message = standsAt(motion.goal, why);
    if (!position_valid && state.end_abrupt) {
      result.message += "; it stopped too fast for the position to be trusted";
    }
  }
  return result;
}

std::string Axis::Impl::standsAt(const Goal& goal, const std::string& why) const {
  const pulse::ChannelState state = driver.engine().channel(channel);
  const double count = static_cast<double>(state.count - state.slack);
  std::string text = config.name + " stands at " + show(positionOf(count));
  if (goal.target) text += ", not at " + show(positionOf(static_cast<double>(*goal.target)));
  return text + ": " + why;
}

std::string Axis::Impl::endedWith(const Goal& goal) const {
  for (const Impl* other : goal.course->axes()) {
    const pulse::ChannelState state = driver.engine().channel(other->channel);
    if (other != this && state.end != pulse::EndReason::kDone &&
        state.end != pulse::EndReason::kCompanion) {
      return "it moved together with " + other->config.name + ", which was stopped";
    }
  }
  return "an axis that it moved together with was stopped";
}

// ---- scales ----

double Axis::Impl::stepsPerUnit() const {
  return config.steps_per_unit * microsteps / config.microsteps;
}

double Axis::Impl::maxSpeed() const {
  // At finer microsteps than the configured ones the chip's own limit may come first.
  const double period =
      static_cast<double>(config.timing.step_high_ns + config.timing.step_low_ns) * 1e-9;
  return std::min(limits_now.max_speed, 1.0 / (period * stepsPerUnit()));
}

std::int64_t Axis::Impl::backlash() const { return std::llround(config.backlash * stepsPerUnit()); }

std::int64_t Axis::Impl::jointCount() {
  const pulse::ChannelState state = harvest();
  return state.count - state.slack;
}

double Axis::Impl::jointAt(double motor) {
  const pulse::ChannelState state = harvest();
  const double slack = static_cast<double>(state.slack) + motor - static_cast<double>(state.count);
  return motor - std::clamp(slack, 0.0, static_cast<double>(backlash()));
}

motion::MotionLimits Axis::Impl::limits(double velocity) const {
  const double scale = stepsPerUnit();
  return {config.start_speed * scale, velocity * scale, limits_now.acceleration * scale,
          limits_now.deceleration * scale, limits_now.jerk * scale};
}

double Axis::Impl::stopDeceleration() const {
  return config.stop_deceleration.value_or(config.deceleration) * stepsPerUnit();
}

std::string Axis::Impl::show(double value, const char* per) const {
  char text[64];
  std::snprintf(text, sizeof(text), "%.9g %s%s", value, config.kind == Kind::kLinear ? "m" : "rad",
                per);
  return text;
}

std::string Axis::Impl::inMilliseconds(pulse::Nanoseconds time) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g ms", static_cast<double>(time) * 1e-6);
  return text;
}

}  // namespace stepdriver::axis
