#pragma once

#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/hardware.h"
#include "stepdriver_core/sim/rig.h"
#include "unthreaded_machine.h"

namespace stepdriver::test {

inline constexpr double kStep = 1.0 / 80'000.0;  // m, of linearAxis()

/// A linear axis with every pin wired, two endstops, 1/16 microsteps, 80 microsteps/mm, 100 mm/s,
/// 1000 mm/s^2, enabled on start.
inline config::AxisConfig linearAxis(const std::string& name,
                                     const std::string& driver_name = "a4988") {
  config::AxisConfig config;
  config.name = name;
  config.joint = name;
  config.driver = driver::driverChip(driver_name);
  config.pins.step.line = name + ".step";
  config.pins.dir.line = name + ".dir";
  config.pins.enable.line = name + ".enable";
  if (driver_name != "tb6600") {
    config.pins.ms1.line = name + ".ms1";
    config.pins.ms2.line = name + ".ms2";
    config.pins.ms3.line = name + ".ms3";
    config.pins.sleep.line = name + ".sleep";
    config.pins.reset.line = name + ".reset";
  }
  config.microsteps = 16;
  config.steps_per_unit = 80'000.0;
  config.steps_per_round = 3200.0;
  config.max_speed = 0.1;
  config.acceleration = 1.0;
  config.deceleration = 1.0;
  config.endstop_min = config::Endstop{{name + ".min", false}};
  config.endstop_max = config::Endstop{{name + ".max", false}};
  config.enable_on_start = true;
  return config;
}

/// The same axis with another scale [steps/unit], speed and acceleration.
inline config::AxisConfig linearAxis(const std::string& name, double scale, double speed,
                                     double acceleration) {
  config::AxisConfig config = linearAxis(name);
  config.steps_per_unit = scale;
  config.max_speed = speed;
  config.acceleration = config.deceleration = acceleration;
  return config;
}

/// The axis on the rig: switches at -100 mm and 100 mm, the carriage at 0.
inline sim::RigAxisSpec rigAxis(const config::AxisConfig& config) {
  const auto wire = [](const config::Pin& pin) { return sim::Wire{pin.line, pin.inverted}; };
  sim::RigAxisSpec spec;
  spec.name = config.name;
  spec.chip = config.driver;
  spec.step = wire(config.pins.step);
  spec.dir = wire(config.pins.dir);
  spec.enable = wire(config.pins.enable);
  spec.ms1 = wire(config.pins.ms1);
  spec.ms2 = wire(config.pins.ms2);
  spec.ms3 = wire(config.pins.ms3);
  spec.sleep = wire(config.pins.sleep);
  spec.reset = wire(config.pins.reset);
  spec.in1 = wire(config.pins.in1);
  spec.in2 = wire(config.pins.in2);
  spec.in3 = wire(config.pins.in3);
  spec.in4 = wire(config.pins.in4);
  spec.keeps_coils = !config.disable_on_shutdown;
  spec.microsteps = config.microsteps;
  spec.full_step_travel = 1000.0 * config.microsteps / config.steps_per_unit;
  const auto endstop = [](const std::optional<config::Endstop>& wanted, double position) {
    std::optional<sim::SwitchSpec> spec_of;
    if (!wanted) return spec_of;
    spec_of.emplace();
    spec_of->line = wanted->line;
    spec_of->active_level = wanted->active_level;
    spec_of->position = position;
    spec_of->hysteresis = 0.2;
    return spec_of;
  };
  if (config.fault) spec.fault_line = config.fault->line;
  if (config.in_position) spec.in_position_line = config.in_position->line;
  if (config.brake) {
    spec.brake = sim::BrakeSpec{config.brake->line, config.brake->release_level,
                                config.brake->release_ns, config.brake->engage_ns};
  }
  if (config.tmc) {
    const int version = config.driver.name == "tmc2130"   ? 0x11
                        : config.driver.name == "tmc5160" ? 0x30
                                                          : 0x21;
    spec.tmc = sim::TmcSpec{config.tmc->port, config.tmc->address, version, true};
  }
  spec.min_switch = endstop(config.endstop_min, -100.0);
  spec.max_switch = endstop(config.endstop_max, 100.0);
  return spec;
}

/// A machine on the simulated rig. Any thread that waits drives its virtual clock.
class Bench {
 public:
  explicit Bench(const std::vector<config::AxisConfig>& axes, bool threaded = false,
                 double speed = 0.0)
      : Bench(axes, rigAxes(axes), threaded, speed) {}

  Bench(const std::vector<config::AxisConfig>& axes, const std::vector<sim::RigAxisSpec>& rig_axes,
        bool threaded = false, double speed = 0.0, const machine::MachineOptions& options = {})
      : clock(speed),
        trace(std::make_shared<sim::MemoryTrace>()),
        rig(judged(rig_axes, axes), trace, couplings(axes), motorPowerOf(options), ioOf(options)),
        backend(rig, [this] { return clock.now(); }) {
    machine = std::make_unique<UnthreadedMachine>(axes, backend, clock, options, threaded);
  }

  /// In a test, no motor may have got steps beyond what the configuration allows.
  ~Bench() {
    if (may_exceed_limits) return;
    for (const std::string& name : rig.axes()) {
      const std::string beyond = rig.report(name).beyond_limits;
      if (beyond.empty()) continue;
#ifdef ADD_FAILURE
      ADD_FAILURE() << name << ": " << beyond;
#else
      std::cerr << name << ": " << beyond << "\n";
      std::abort();
#endif
    }
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  /// The relay of the motor power, as it is configured.
  static std::optional<sim::MotorPowerSpec> motorPowerOf(const machine::MachineOptions& options) {
    const auto& config = options.motor_power;
    if (!config) return std::nullopt;
    sim::MotorPowerSpec spec{config->line, config->active_level, config->on_ns, "", false};
    if (config->feedback) {
      spec.feedback_line = config->feedback->line;
      spec.feedback_active = config->feedback->active_level;
    }
    return spec;
  }

  /// The lines with a name, as they are configured.
  static sim::RigIo ioOf(const machine::MachineOptions& options) {
    sim::RigIo io;
    for (const config::OutputConfig& output : options.outputs) {
      io.outputs.push_back({output.name, output.line, output.active_level});
    }
    for (const config::InputConfig& input : options.inputs) {
      sim::SwitchSpec contact;
      contact.line = input.line.line;
      contact.active_level = input.line.active_level;
      io.inputs.push_back({input.name, contact});
    }
    return io;
  }

  static std::vector<sim::RigAxisSpec> rigAxes(const std::vector<config::AxisConfig>& axes) {
    std::vector<sim::RigAxisSpec> specs;
    specs.reserve(axes.size());
    for (const config::AxisConfig& config : axes) specs.push_back(rigAxis(config));
    return specs;
  }

  /// The rig knows what the configuration allows each motor, and has motors that can do that.
  static std::vector<sim::RigAxisSpec> judged(std::vector<sim::RigAxisSpec> specs,
                                              const std::vector<config::AxisConfig>& axes) {
    for (std::size_t number = 0; number < axes.size(); ++number) {
      for (std::size_t i = 0; i < axes[number].motors(); ++i) {
        for (sim::RigAxisSpec& spec : specs) {
          if (spec.name != axes[number].traceName(i)) continue;
          if (!spec.limits) spec.limits = setup::motorLimits(axes, number);
          if (!spec.motor) spec.motor = setup::motorOf(axes, number);
        }
      }
    }
    return specs;
  }

  static std::vector<sim::RigCoupling> couplings(const std::vector<config::AxisConfig>& axes) {
    std::vector<sim::RigCoupling> couplings;
    for (const config::AxisConfig& config : axes) {
      const auto& shared = config.kinematics;
      if (shared == nullptr || shared->axes.front() != config.name) continue;
      couplings.push_back({shared->axes, shared->matrix, shared->inverse});
    }
    return couplings;
  }

  axis::Axis& axis(const std::string& name = "x") { return machine->axis(name); }
  sim::RigAxisReport report(const std::string& name = "x") { return rig.report(name); }

  /// Forward minus backward pulses that the chip has seen.
  std::int64_t pulses(const std::string& name = "x") {
    const sim::RigAxisReport seen = report(name);
    return seen.pulses_forward - seen.pulses_backward;
  }

  axis::MoveResult move(double position, const std::string& name = "x") {
    return axis(name).wait(axis(name).moveTo(position));
  }

  bool may_exceed_limits = false;
  pulse::VirtualClock clock;
  std::shared_ptr<sim::MemoryTrace> trace;
  sim::Rig rig;
  gpio::SimulatedBackend backend;
  std::unique_ptr<UnthreadedMachine> machine;
};

/// The violations of the axis in a report, in words.
inline std::string violationsOf(const sim::RigAxisReport& report) {
  std::string text;
  for (const auto& [kind, count] : report.violations) {
    text += std::string(sim::nameOf(kind)) + ": " + std::to_string(count) + "; ";
  }
  return text + report.beyond_limits;
}

}  // namespace stepdriver::test
