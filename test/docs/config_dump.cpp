#include "config_dump.h"

#include <optional>
#include <sstream>

namespace stepdriver::docs {
namespace {

class Dump {
 public:
  template <typename Value>
  void add(const Value& value) {
    text_ << value << ' ';
  }
  template <typename Value>
  void add(const std::optional<Value>& value) {
    if (value) {
      add(*value);
    } else {
      text_ << "none ";
    }
  }
  void add(Bias bias) { add(static_cast<int>(bias)); }
  void add(const config::Pin& pin) { all(pin.line, pin.inverted); }
  void add(const config::InputSwitch& input) { all(input.line, input.active_level, input.bias); }
  void add(const config::Endstop& endstop) {
    add(static_cast<const config::InputSwitch&>(endstop));
    add(endstop.shared);
  }
  void add(const machine::HeartbeatConfig& heartbeat) { all(heartbeat.line, heartbeat.rate); }
  void add(const config::MotorPowerConfig& power) {
    all(power.line, power.active_level, power.on_ns, power.off_delay_ns, power.feedback,
        power.feedback_timeout_ns);
  }
  void add(const config::FaultPin& fault) { all(fault.line, fault.bias); }
  void add(const config::InPositionPin& in_position) {
    all(in_position.line, in_position.bias, in_position.timeout);
  }
  void add(const config::BrakeConfig& brake) {
    all(brake.line, brake.release_level, brake.release_ns, brake.engage_ns);
  }
  void add(const config::StallConfig& stall) { all(stall.threshold, stall.current, stall.phase); }
  void add(const config::StallFaultConfig& stall) { all(stall.threshold, stall.above); }
  void add(const config::TmcConfig& tmc) {
    all(tmc.port, tmc.baud, tmc.address, tmc.sense_resistor, tmc.run_current, tmc.hold_current,
        tmc.hold_delay, static_cast<int>(tmc.mode), tmc.spread_cycle_above, tmc.interpolate,
        tmc.stall, tmc.stall_fault, tmc.idle_current);
  }
  void add(const config::HomingConfig& homing) {
    all(static_cast<int>(homing.kind), homing.at_max, homing.input, homing.flag, homing.approaches,
        homing.seek_speed, homing.latch_speed, homing.pull_off, homing.final_position,
        homing.offset, homing.max_travel, homing.timeout, homing.debounce, homing.order,
        static_cast<int>(homing.check_at_flag), homing.flag_tolerance);
  }
  void add(const driver::Timing& timing) {
    all(timing.step_high_ns, timing.step_low_ns, timing.dir_setup_ns, timing.dir_hold_ns,
        timing.mode_setup_ns, timing.mode_hold_ns, timing.enable_ns, timing.wake_ns,
        timing.reset_low_ns, timing.reset_wait_ns);
  }
  void add(const driver::DriverChip& chip) {
    all(chip.name, chip.timing, chip.mode_pins, chip.step_active,
        static_cast<int>(chip.step_inputs), chip.both_edges, chip.enable_on, chip.sleep_asleep,
        chip.reset_held, chip.fault_active, static_cast<int>(chip.fault_end),
        chip.in_position_active, static_cast<int>(chip.disabled), static_cast<int>(chip.asleep));
    for (const driver::Mode& mode : chip.modes) {
      add(mode.microsteps);
      for (const bool level : mode.code) add(level);
    }
    for (const int microsteps : chip.microsteps) add(microsteps);
  }
  void add(const config::Pins& pins) {
    all(pins.step, pins.dir, pins.enable, pins.ms1, pins.ms2, pins.ms3, pins.sleep, pins.reset,
        pins.in1, pins.in2, pins.in3, pins.in4);
  }
  void add(const config::MotorConfig& motor) {
    all(motor.motor, motor.driver, motor.pins, motor.endstop_min, motor.endstop_max, motor.fault,
        motor.fault_ramps, motor.in_position, motor.offset, motor.tmc);
  }
  void add(const config::Kinematics& kinematics) {
    for (const std::string& name : kinematics.axes) add(name);
    for (const auto& row : kinematics.matrix) {
      for (const double value : row) add(value);
    }
  }
  void add(const config::AxisConfig& axis) {
    all(axis.name, axis.joint, static_cast<int>(axis.kind), axis.microsteps, axis.steps_per_unit,
        axis.steps_per_round, axis.max_skew);
    for (std::size_t i = 0; i < axis.motors(); ++i) add(axis.motorAt(i));
    if (axis.kinematics) add(*axis.kinematics);
    all(axis.max_speed, axis.start_speed, axis.acceleration, axis.deceleration,
        axis.stop_deceleration, axis.jerk, axis.backlash, axis.min_position, axis.max_position);
    for (const config::ShaperConfig& shaper : axis.input_shaper) {
      all(static_cast<int>(shaper.type), shaper.frequency, shaper.damping);
    }
    all(axis.brake, axis.homing, axis.require_homing, axis.enable_on_start,
        axis.disable_on_shutdown, axis.align_on_microstep_change, axis.idle_timeout,
        static_cast<int>(axis.idle_action), axis.holds_position_unpowered, axis.switch_release,
        axis.assumed_end_is_max);
  }
  void add(const setup::SimulatedAxis& rig) {
    all(rig.start, rig.switch_hysteresis, rig.bounces, rig.bounce_ms, rig.min_switch,
        rig.max_switch, rig.load_falls, rig.spring_hz, rig.spring_damping,
        rig.fail_step_write_after, rig.settling_ms, rig.faults.never_in_position, rig.block_min,
        rig.block_max);
    all(rig.motor.pole_pairs, rig.motor.holding_torque, rig.motor.rotor_inertia,
        rig.motor.load_inertia, rig.motor.friction, rig.motor.damping);
    all(rig.wiring.dir_inverted, rig.wiring.steps_per_unit, rig.wiring.min_pin, rig.wiring.max_pin,
        rig.wiring.min_active_level, rig.wiring.max_active_level);
    all(rig.faults.min_stuck, rig.faults.max_stuck, rig.faults.lose_every,
        rig.faults.chip_fault_after, rig.faults.chip_fault_lasts_ns);
    for (const auto& [name, motor] : rig.motors) all(name, motor);
  }
  void add(const config::OutputConfig& output) {
    all(output.name, output.line, output.active_level, output.initial, output.at_stop,
        output.at_fault, output.max_on_ns, output.min_on_ns, output.min_off_ns);
  }
  void add(const config::InputConfig& input) { all(input.name, input.line, input.debounce_ns); }
  void add(const setup::SimulatedOutput& output) { add(output.fail_write_after); }
  void add(const setup::SimulatedInput& input) {
    all(input.pressed, input.bounces, input.bounce_ms, input.axis, input.from, input.to,
        input.every, input.hysteresis);
  }
  void add(const joystick::JogAxis& axis) {
    all(axis.name, axis.joystick_axis, static_cast<int>(axis.kind), axis.max_speed,
        axis.stick.max_speed, axis.stick.dead_band, axis.stick.exponent, axis.stick.inverted,
        axis.disable_in_dead_band, axis.disable_after);
  }
  void add(const base::Variances& variances) {
    for (const double variance : variances) add(variance);
  }
  void add(const base::WheelConfig& wheel) {
    all(wheel.axis, static_cast<int>(wheel.side), wheel.diameter);
  }
  void add(const base::SteeringConfig& steering) {
    all(steering.axis, steering.wheelbase, steering.max_angle);
  }
  template <typename... Values>
  void all(const Values&... values) {
    (add(values), ...);
  }

  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

}  // namespace

std::string dump(const ros_node::NodeConfig& config) {
  Dump dump;
  dump.all(static_cast<int>(config.backend), config.joint_state_rate, config.jog_timeout,
           config.max_lateness, config.write_timeout, config.enforce_realtime,
           config.keep_cpus_awake, config.cpu, config.emergency_stop,
           static_cast<int>(config.emergency_disable), config.heartbeat, config.motor_power,
           config.state_file, config.recorder.seconds, config.recorder.memory_mb,
           config.recorder.folder, config.recorder.keep, config.hardware_id, config.urdf_limits,
           config.publish_clock, config.stop_on_master_lost, config.allow_slower,
           static_cast<int>(config.setpoint_mode), config.setpoint_timeout);
  for (const auto& axis : config.axes) dump.add(axis);
  dump.all(config.simulation.speed, config.simulation.trace,
           config.simulation.trace_overwrites_any_file, config.simulation.emergency_stop);
  for (const auto& rig : config.simulation.axes) dump.add(rig.second);
  for (const auto& output : config.outputs) dump.add(output);
  for (const auto& input : config.inputs) dump.add(input);
  for (const auto& board : config.boards) {
    dump.all(board.name, board.port, board.baud, board.ahead, board.step_error, board.reset);
  }
  for (const auto& output : config.simulation.outputs) dump.add(output.second);
  for (const auto& input : config.simulation.inputs) dump.add(input.second);
  return dump.text();
}

std::string dump(const joystick::JoystickConfig& config) {
  Dump dump;
  dump.all(config.driver, config.rate, config.joy_timeout, config.deadman_button);
  for (const auto& axis : config.axes) dump.add(axis);
  return dump.text();
}

std::string dump(const base::BaseConfig& config) {
  Dump dump;
  dump.all(config.driver, config.rate, config.cmd_vel_timeout, config.driver_timeout,
           config.odom_frame, config.base_frame, config.publish_tf, config.pose_variances,
           config.twist_variances, config.separation, config.steering);
  for (const auto& wheel : config.wheels) dump.add(wheel);
  return dump.text();
}

}  // namespace stepdriver::docs
