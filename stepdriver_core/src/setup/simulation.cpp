#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

#include "message_text.h"
#include "setup/read_simulation.h"
#include "sim/vcd_trace.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::setup {
namespace {

using config::AxisConfig;
using config::Kind;

// A switch without a configured position is this far outside the soft limit,
constexpr double kSwitchMargin = 2.0;  // [mm|deg]
// or, if there is no soft limit, this far from the origin or from the other soft limit.
constexpr double kFarLinear = 100.0;  // [mm]
constexpr double kFarRotary = 360.0;  // [deg]

struct SwitchPlaces {
  double min = 0.0;  ///< [mm|deg]
  double max = 0.0;
};

SwitchPlaces switchPlaces(const AxisConfig& axis, const SimulatedAxis& simulated) {
  const double scale = config::configUnitsPerUnit(axis.kind);
  const double far = axis.kind == Kind::kLinear ? kFarLinear : kFarRotary;
  SwitchPlaces places{-far, far};
  if (axis.min_position) places.min = *axis.min_position * scale - kSwitchMargin;
  if (axis.max_position) places.max = *axis.max_position * scale + kSwitchMargin;
  if (!axis.min_position) places.min = std::min(places.min, places.max - 2 * far);
  if (!axis.max_position) places.max = std::max(places.max, places.min + 2 * far);
  if (axis.homing) (axis.homing->at_max ? places.max : places.min) += axis.offset * scale;
  places.min = simulated.min_switch.value_or(places.min);
  places.max = simulated.max_switch.value_or(places.max);
  return places;
}

/// The version that the chip tells; of a TMC2226 that of a TMC2209.
int versionOf(const std::string& chip) {
  if (chip == "tmc2208") return 0x20;
  if (chip == "tmc2130") return 0x11;
  return chip == "tmc5160" ? 0x30 : 0x21;
}

sim::Wire wireOf(const config::Pin& pin) { return {pin.line, pin.inverted}; }

std::optional<sim::SwitchSpec> switchOf(const std::optional<config::Endstop>& endstop,
                                        const SimulatedAxis& simulated, double position) {
  if (!endstop) return {};
  sim::SwitchSpec spec;
  spec.line = endstop->line;
  spec.active_level = endstop->active_level;
  spec.position = position;
  spec.hysteresis = simulated.switch_hysteresis;
  spec.bounces = simulated.bounces;
  spec.bounce_ns = std::llround(simulated.bounce_ms * 1e6);
  return spec;
}

/// The axis as it is really wired.
AxisConfig wired(AxisConfig axis, const SimulatedWiring& wiring) {
  const bool cw_ccw = axis.hasCwCcwInputs();
  if (wiring.dir_inverted.value_or(false) && axis.hasPhases()) {
    std::swap(axis.pins.in1, axis.pins.in4);
    std::swap(axis.pins.in2, axis.pins.in3);
  }
  if (wiring.dir_inverted && !cw_ccw) axis.pins.dir.inverted = *wiring.dir_inverted;
  if (wiring.dir_inverted.value_or(false) && cw_ccw) std::swap(axis.pins.step, axis.pins.dir);
  if (wiring.steps_per_unit) {
    axis.steps_per_unit = *wiring.steps_per_unit * config::configUnitsPerUnit(axis.kind);
  }
  if (axis.endstop_min && wiring.min_pin) axis.endstop_min->line = *wiring.min_pin;
  if (axis.endstop_max && wiring.max_pin) axis.endstop_max->line = *wiring.max_pin;
  if (axis.endstop_min && wiring.min_active_level) {
    axis.endstop_min->active_level = *wiring.min_active_level;
  }
  if (axis.endstop_max && wiring.max_active_level) {
    axis.endstop_max->active_level = *wiring.max_active_level;
  }
  return axis;
}

/// One motor of an axis with several, as if the axis had no other.
AxisConfig motorAlone(const AxisConfig& axis, std::size_t motor) {
  AxisConfig alone = axis;
  alone.twins.clear();
  static_cast<config::MotorConfig&>(alone) = axis.motorAt(motor);
  alone.name = axis.traceName(motor);
  return alone;
}

/// A homing to a block has an input that reports it.
void reportBlock(const AxisConfig& axis, const std::vector<config::InputConfig>& inputs,
                 sim::RigAxisSpec& spec) {
  if (!axis.homing || axis.homing->kind != config::HomingKind::kBlock) return;
  if (axis.homing->input.empty()) {
    spec.stall_line = spec.fault_line;
    spec.stall_active = axis.driver.fault_active.value_or(false);
  }
  for (const config::InputConfig& input : inputs) {
    if (input.name != axis.homing->input) continue;
    spec.stall_line = input.line.line;
    spec.stall_active = input.line.active_level;
  }
}

/// Inputs that the carriage presses.
void addFlags(const AxisConfig& axis, const std::vector<config::InputConfig>& inputs,
              const SimulationConfig& config, sim::RigAxisSpec& spec) {
  for (const config::InputConfig& input : inputs) {
    const auto found = config.inputs.find(input.name);
    if (found == config.inputs.end() || found->second.axis != axis.name) continue;
    const SimulatedInput& simulated = found->second;
    sim::SwitchSpec flag;
    flag.line = input.line.line;
    flag.active_level = input.line.active_level;
    flag.position = simulated.from;
    flag.end = simulated.to;
    flag.every = simulated.every;
    flag.hysteresis = simulated.hysteresis;
    flag.bounces = simulated.bounces;
    flag.bounce_ns = std::llround(simulated.bounce_ms * 1e6);
    spec.flags.push_back(std::move(flag));
  }
}

sim::RigAxisSpec rigAxisOf(const AxisConfig& configured, const SimulatedAxis& simulated,
                           const std::vector<config::InputConfig>& inputs) {
  const AxisConfig axis = wired(configured, simulated.wiring);
  sim::RigAxisSpec spec;
  spec.name = axis.name;
  spec.chip = axis.driver;
  spec.step = wireOf(axis.pins.step);
  spec.dir = wireOf(axis.pins.dir);
  spec.enable = wireOf(axis.pins.enable);
  spec.ms1 = wireOf(axis.pins.ms1);
  spec.ms2 = wireOf(axis.pins.ms2);
  spec.ms3 = wireOf(axis.pins.ms3);
  spec.sleep = wireOf(axis.pins.sleep);
  spec.reset = wireOf(axis.pins.reset);
  spec.in1 = wireOf(axis.pins.in1);
  spec.in2 = wireOf(axis.pins.in2);
  spec.in3 = wireOf(axis.pins.in3);
  spec.in4 = wireOf(axis.pins.in4);
  spec.keeps_coils = !axis.disable_on_shutdown;
  spec.microsteps = axis.microsteps;
  spec.full_step_travel =
      axis.microsteps / axis.steps_per_unit * config::configUnitsPerUnit(axis.kind);
  spec.start = simulated.start;
  if (axis.fault) spec.fault_line = axis.fault->line;
  if (axis.in_position) spec.in_position_line = axis.in_position->line;
  spec.settling_ns = std::llround(simulated.settling_ms * 1e6);
  if (axis.brake) {
    spec.brake = sim::BrakeSpec{axis.brake->line, axis.brake->release_level, axis.brake->release_ns,
                                axis.brake->engage_ns};
  }
  if (axis.tmc) {
    spec.tmc = sim::TmcSpec{axis.tmc->port, axis.tmc->address, versionOf(axis.driver.name), true};
  }
  spec.load_falls = simulated.load_falls;
  if (simulated.spring_hz > 0.0) {
    spec.spring = sim::SpringSpec{simulated.spring_hz, simulated.spring_damping};
  }
  const SwitchPlaces places = switchPlaces(axis, simulated);
  spec.min_switch = switchOf(axis.endstop_min, simulated, places.min);
  spec.max_switch = switchOf(axis.endstop_max, simulated, places.max);
  spec.block_min = simulated.block_min;
  spec.block_max = simulated.block_max;
  if (axis.homing && axis.homing->kind == config::HomingKind::kStall) {
    const double scale = config::configUnitsPerUnit(axis.kind);
    auto& block = axis.homing->at_max ? spec.block_max : spec.block_min;
    if (!block) block = axis.homing->offset * scale;
  }
  reportBlock(axis, inputs, spec);
  return spec;
}

// An axis that a program has added is as configured.
const SimulatedAxis& simulatedOf(const SimulationConfig& config, const AxisConfig& axis) {
  static const SimulatedAxis as_configured;
  const auto found = config.axes.find(axis.name);
  return found != config.axes.end() ? found->second : as_configured;
}

std::vector<sim::RigAxisSpec> rigOf(const std::vector<AxisConfig>& axes,
                                    const SimulationConfig& config,
                                    const std::vector<config::InputConfig>& inputs) {
  std::vector<sim::RigAxisSpec> rig;
  rig.reserve(axes.size());
  for (std::size_t number = 0; number < axes.size(); ++number) {
    const AxisConfig& axis = axes[number];
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      const SimulatedAxis& simulated = simulatedOf(config, axis).ofMotor(axis.motorAt(i).motor);
      rig.push_back(rigAxisOf(motorAlone(axis, i), simulated, inputs));
      if (i == 0) addFlags(axis, inputs, config, rig.back());
      rig.back().limits = motorLimits(axes, number);
      rig.back().motor = motorOf(axes, number, simulated.motor);
    }
  }
  return rig;
}

std::vector<sim::RigCoupling> couplingsOf(const std::vector<AxisConfig>& axes) {
  std::vector<sim::RigCoupling> couplings;
  for (const AxisConfig& axis : axes) {
    const auto& shared = axis.kinematics;
    if (shared == nullptr || shared->axes.front() != axis.name) continue;
    couplings.push_back({shared->axes, shared->matrix, shared->inverse});
  }
  return couplings;
}

std::optional<sim::MotorPowerSpec> relayOf(const std::optional<config::MotorPowerConfig>& config) {
  if (!config) return {};
  sim::MotorPowerSpec spec{config->line, config->active_level, config->on_ns, "", false};
  if (config->feedback) {
    spec.feedback_line = config->feedback->line;
    spec.feedback_active = config->feedback->active_level;
  }
  return spec;
}

sim::RigIo ioOf(const std::vector<config::OutputConfig>& outputs,
                const std::vector<config::InputConfig>& inputs, const SimulationConfig& config) {
  sim::RigIo io;
  for (const config::OutputConfig& output : outputs) {
    io.outputs.push_back({output.name, output.line, output.active_level});
  }
  for (const config::InputConfig& input : inputs) {
    const auto found = config.inputs.find(input.name);
    const SimulatedInput simulated =
        found != config.inputs.end() ? found->second : SimulatedInput();
    sim::SwitchSpec contact;
    contact.line = input.line.line;
    contact.active_level = input.line.active_level;
    contact.bounces = simulated.bounces;
    contact.bounce_ns = std::llround(simulated.bounce_ms * 1e6);
    io.inputs.push_back({input.name, contact});
  }
  return io;
}

std::shared_ptr<sim::PinTrace> traceOf(const SimulationConfig& config) {
  if (config.trace.empty()) return nullptr;
  using Replaces = sim::VcdTrace::Replaces;
  return std::make_shared<sim::VcdTrace>(
      config.trace, config.trace_overwrites_any_file ? Replaces::kAnyFile : Replaces::kTraces);
}

/// The limits of an axis, in steps of a motor.
sim::MotorLimits limitsOf(const AxisConfig& axis, double steps_per_unit) {
  const double acceleration = std::max(
      {axis.acceleration, axis.deceleration, axis.stop_deceleration.value_or(axis.deceleration)});
  return {axis.max_speed * steps_per_unit, acceleration * steps_per_unit,
          axis.start_speed * steps_per_unit};
}

}  // namespace

sim::MotorLimits motorLimits(const std::vector<AxisConfig>& axes, std::size_t axis) {
  if (axis >= axes.size()) {
    throw Error(fmt::format("there is no axis number {} (axes: {})", axis, axes.size()));
  }
  const AxisConfig& own = axes[axis];
  if (own.kinematics == nullptr) return limitsOf(own, own.steps_per_unit);
  const config::Kinematics& shared = *own.kinematics;
  const std::size_t motor = shared.numberOf(own.name);
  if (motor >= shared.matrix.size()) {
    throw Error(fmt::format("{} isn't one of the axes with which it shares its motors", own.name));
  }
  const std::vector<double>& row = shared.matrix[motor];
  sim::MotorLimits sum;
  for (const AxisConfig& sharer : axes) {
    const std::size_t number = shared.numberOf(sharer.name);
    if (number >= row.size()) continue;
    const sim::MotorLimits part = limitsOf(sharer, std::abs(row[number]) * own.steps_per_unit);
    sum.rate += part.rate;
    sum.acceleration += part.acceleration;
    sum.start_rate += part.start_rate;
  }
  return sum;
}

sim::MotorSpec motorOf(const std::vector<AxisConfig>& axes, std::size_t axis,
                       const SimulatedMotor& simulated) {
  constexpr double kGramSquareCentimetre = 1e-7;  // kg m^2
  sim::MotorSpec motor;
  motor.pole_pairs = simulated.pole_pairs;
  motor.inertia = (simulated.rotor_inertia + simulated.load_inertia) * kGramSquareCentimetre;
  motor.friction = simulated.friction;
  motor.damping = simulated.damping;
  if (simulated.holding_torque) {
    motor.holding_torque = *simulated.holding_torque;
    return motor;
  }
  const sim::MotorLimits limits = motorLimits(axes, axis);
  const double microsteps = axes[axis].microsteps;
  return sim::soundMotor(motor, limits.rate / microsteps, limits.acceleration / microsteps);
}

void checkSimulation(const std::vector<AxisConfig>& axes, const SimulationConfig& config,
                     const std::string& name, std::vector<ConfigIssue>& issues) {
  for (const AxisConfig& axis : axes) {
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      const config::MotorConfig& motor = axis.motorAt(i);
      if (!motor.endstop_min || !motor.endstop_max) continue;
      const SimulatedAxis& simulated = simulatedOf(config, axis).ofMotor(motor.motor);
      const SwitchPlaces places = switchPlaces(motorAlone(axis, i), simulated);
      if (places.min < places.max) continue;
      issues.push_back(
          {fmt::format("{}/axes/{}{}{}", name, axis.name, motor.motor.empty() ? "" : "/motors/",
                       motor.motor),
           fmt::format(
               "has the min switch at {}, but it must be below the max switch, which is at {}",
               roughText(places.min), roughText(places.max))});
    }
  }
}

Simulation::Simulation(const std::vector<AxisConfig>& axes,
                       std::optional<config::InputSwitch> emergency_stop,
                       const std::optional<config::MotorPowerConfig>& motor_power,
                       const SimulationConfig& config,
                       const std::vector<config::OutputConfig>& outputs,
                       const std::vector<config::InputConfig>& inputs)
    : axes_(axes),
      emergency_stop_(std::move(emergency_stop)),
      inputs_(inputs),
      clock_(config.speed),
      rig_(rigOf(axes, config, inputs), traceOf(config), couplingsOf(axes), relayOf(motor_power),
           ioOf(outputs, inputs, config)),
      backend_(rig_, [this] { return timeOfEdge(); }) {
  for (const AxisConfig& axis : axes) {
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      const config::MotorConfig& motor = axis.motorAt(i);
      const SimulatedAxis& simulated = simulatedOf(config, axis).ofMotor(motor.motor);
      faults_[axis.traceName(i)] = simulated.faults;
      rig_.setFaults(axis.traceName(i), simulated.faults);
      if (simulated.fail_step_write_after) {
        const config::Pin& pin = motor.hasPhases() ? motor.pins.in1 : motor.pins.step;
        rig_.failWrites(pin.line, *simulated.fail_step_write_after, EIO);
      }
    }
  }
  if (emergency_stop_) pressEmergencyStop(config.emergency_stop);
  for (const auto& [name, simulated] : config.inputs) {
    if (simulated.pressed) pressInput(name, true);
  }
  for (const config::OutputConfig& output : outputs) {
    const auto found = config.outputs.find(output.name);
    if (found == config.outputs.end() || !found->second.fail_write_after) continue;
    rig_.failWrites(output.line, *found->second.fail_write_after, EIO);
  }
}

pulse::Nanoseconds Simulation::timeOfEdge() {
  const std::uint64_t stalls = clock_.stalls();
  if (stalls_.exchange(stalls) != stalls) rig_.clockStalled();
  return clock_.now();
}

void Simulation::pressEmergencyStop(bool pressed) {
  if (!emergency_stop_) throw Refused("emergency_stop isn't configured: there is no button");
  rig_.setInput(emergency_stop_->line, pressed == emergency_stop_->active_level, clock_.now());
}

void Simulation::pressInput(const std::string& name, bool pressed) {
  rig_.pressInput(name, pressed, clock_.now());
}

void Simulation::pressEndstop(const std::string& axis, End end, bool pressed) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto pressed_axis = std::find_if(
      axes_.begin(), axes_.end(), [&](const AxisConfig& known) { return known.name == axis; });
  if (pressed_axis == axes_.end()) throw Error("the rig has no axis named " + axis);
  const bool at_max = end == End::kMax;
  if (!pressed_axis->hasEndstop(at_max)) {
    throw Refused(fmt::format("{} has no switch at the {} end", axis, at_max ? "max" : "min"));
  }
  for (std::size_t i = 0; i < pressed_axis->motors(); ++i) {
    const std::string rig_axis = pressed_axis->traceName(i);
    const sim::RigFaults& always = faults_.at(rig_axis);
    sim::RigFaults& now = pressed_.try_emplace(rig_axis, always).first->second;
    if (end == End::kMin) now.min_stuck = pressed ? std::optional<bool>(true) : always.min_stuck;
    if (end == End::kMax) now.max_stuck = pressed ? std::optional<bool>(true) : always.max_stuck;
    rig_.setFaults(rig_axis, now);
  }
}

}  // namespace stepdriver::setup
