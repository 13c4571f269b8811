#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "message_text.h"
#include "setup/read_simulation.h"

namespace stepdriver::setup {
namespace {

using config::ConfigReader;
using config::Presence;
using config::Range;

constexpr double kHighestSpeed = 1e6;
constexpr int kMostBounces = 1000;
constexpr double kLongestBounceMs = 1000.0;
constexpr double kLongestSettlingMs = 60'000.0;
constexpr double kLongestFaultMs = 3.6e6;
constexpr double kHighestHz = 1000.0;
constexpr double kMostDamping = 0.9;
// Twelve decades of torque and fifteen of inertia: far beyond any motor, and its frequency is still
// a number.
constexpr Range kTorques{1e-6, 1e6};        // Nm
constexpr Range kRotorInertias{1e-6, 1e9};  // g cm^2
constexpr Range kLoadInertias{0.0, 1e9};
constexpr Range kFrictions{0.0, 1e6};  // Nm
constexpr Range kMotorDampings{0.01, 10.0};
constexpr int kMostPolePairs = 1000;
constexpr int kMostWrites = std::numeric_limits<int>::max();

/// Reads the rig of one axis, or of one of its motors.
class SimulatedAxisReader {
 public:
  /// @param unit suffix of the keys with a length; empty: uncertain, so both are accepted.
  SimulatedAxisReader(ConfigReader reader, std::string unit)
      : reader_(std::move(reader)), unit_(std::move(unit)) {}

  /// @param axis what it is without the keys of the map.
  SimulatedAxis read(SimulatedAxis axis = {}) {
    axis.start = length("start", Range{}).value_or(axis.start);
    axis.switch_hysteresis =
        length("switch_hysteresis", Range::notNegative()).value_or(axis.switch_hysteresis);
    if (const auto place = length("min_switch", Range{})) axis.min_switch = place;
    if (const auto place = length("max_switch", Range{})) axis.max_switch = place;
    if (const auto place = length("block_min", Range{})) axis.block_min = place;
    if (const auto place = length("block_max", Range{})) axis.block_max = place;
    axis.bounces = reader_.integer("bounces", 0, kMostBounces, axis.bounces);
    axis.bounce_ms =
        reader_.number("bounce_ms", Range{0.0, kLongestBounceMs, true}, axis.bounce_ms);
    axis.settling_ms =
        reader_.number("settling_ms", Range{0.0, kLongestSettlingMs}, axis.settling_ms);
    axis.faults.never_in_position = reader_.boolean("never_in_position", false);
    axis.load_falls = speed("load_falls").value_or(axis.load_falls);
    axis.spring_hz = reader_.number("spring_hz", Range{0.0, kHighestHz}, axis.spring_hz);
    axis.spring_damping =
        reader_.number("spring_damping", Range{0.0, kMostDamping}, axis.spring_damping);
    readMotor(axis.motor);
    readWiring(axis.wiring);
    axis.faults.min_stuck = stuck("min_stuck");
    axis.faults.max_stuck = stuck("max_stuck");
    axis.faults.lose_every = reader_.integer("lose_every", 0, kMostWrites, 0);
    if (const auto steps =
            reader_.findInteger("chip_fault_after", 0, kMostWrites, Presence::kOptional)) {
      axis.faults.chip_fault_after = *steps;
    }
    axis.faults.chip_fault_lasts_ns =
        std::llround(reader_.number("chip_fault_ms", Range{0.0, kLongestFaultMs}, 0.0) * 1e6);
    axis.fail_step_write_after =
        reader_.findInteger("fail_step_write_after", 0, kMostWrites, Presence::kOptional);
    return axis;
  }

  /// @param motors the names of several; empty if there is only one.
  SimulatedAxis readWithMotors(const std::vector<std::string>& motors) {
    SimulatedAxis axis = read();
    if (!motors.empty()) {
      ConfigReader reader = reader_.map("motors");
      for (const std::string& motor : motors) {
        if (!reader.has(motor)) continue;
        SimulatedAxisReader own(reader.map(motor), unit_);
        SimulatedAxis without_faults = axis;
        without_faults.faults = {};
        without_faults.wiring = {};
        axis.motors[motor] = own.read(without_faults);
        own.reader_.rejectUnknown();
      }
      for (const std::string& motor : motors) reader.allow(motor);
      reader.rejectUnknown();
    }
    reader_.rejectUnknown();
    return axis;
  }

 private:
  std::optional<double> length(const std::string& what, const Range& range) {
    if (!unit_.empty()) return reader_.findNumber(what + "_" + unit_, range, Presence::kOptional);
    reader_.findNumber(what + "_mm", range, Presence::kOptional);
    reader_.findNumber(what + "_deg", range, Presence::kOptional);
    return {};
  }

  std::optional<double> speed(const std::string& what) {
    std::optional<double> value;
    for (const char* unit : {"mm", "deg"}) {
      if (!unit_.empty() && unit_ != unit) continue;
      value =
          reader_.findNumber(what + "_" + unit + "_s", Range::notNegative(), Presence::kOptional);
    }
    return value;
  }

  void readMotor(SimulatedMotor& motor) {
    ConfigReader reader = reader_.map("motor");
    motor.pole_pairs = reader.integer("pole_pairs", 1, kMostPolePairs, motor.pole_pairs);
    const auto torque = reader.findNumber("holding_torque_nm", kTorques, Presence::kOptional);
    if (torque) motor.holding_torque = torque;
    motor.rotor_inertia = reader.number("rotor_inertia_g_cm2", kRotorInertias, motor.rotor_inertia);
    motor.load_inertia = reader.number("load_inertia_g_cm2", kLoadInertias, motor.load_inertia);
    motor.friction = reader.number("friction_nm", kFrictions, motor.friction);
    motor.damping = reader.number("damping", kMotorDampings, motor.damping);
    reader.rejectUnknown();
  }

  void readWiring(SimulatedWiring& wiring) {
    ConfigReader reader = reader_.map("wiring");
    wiring.dir_inverted = reader.findBoolean("dir_inverted", Presence::kOptional);
    for (const char* key : {"steps_per_mm", "steps_per_degree"}) {
      const bool wanted = unit_.empty() || (unit_ == "mm") == (key == std::string("steps_per_mm"));
      if (!wanted) continue;
      const auto steps = reader.findNumber(key, Range::positive(), Presence::kOptional);
      if (steps) wiring.steps_per_unit = steps;
    }
    wiring.min_pin = reader.findText("min_pin", Presence::kOptional);
    wiring.max_pin = reader.findText("max_pin", Presence::kOptional);
    wiring.min_active_level = level(reader, "min_active_level");
    wiring.max_active_level = level(reader, "max_active_level");
    reader.rejectUnknown();
  }

  static std::optional<bool> level(ConfigReader& reader, const std::string& key) {
    const auto level =
        reader.findOneOf(key, std::vector<std::string>{"low", "high"}, Presence::kOptional);
    if (!level) return {};
    return *level == "high";
  }

  std::optional<bool> stuck(const std::string& key) {
    const std::string how = reader_.oneOf(key, {"active", "inactive", "none"}, "none");
    if (how == "none") return {};
    return how == "active";
  }

  ConfigReader reader_;
  std::string unit_;
};

/// The names of several motors; empty if the axis has only one.
std::vector<std::string> motorsOf(const config::AxisConfig& axis) {
  std::vector<std::string> names;
  for (std::size_t i = 0; axis.motors() > 1 && i < axis.motors(); ++i) {
    names.push_back(axis.motorAt(i).motor);
  }
  return names;
}

void readOutputsOfRig(ConfigReader all, const std::vector<config::OutputConfig>& outputs,
                      SimulationConfig& config) {
  for (const config::OutputConfig& output : outputs) {
    ConfigReader reader = all.map(output.name);
    config.outputs[output.name].fail_write_after =
        reader.findInteger("fail_write_after", 0, kMostWrites, Presence::kOptional);
    reader.rejectUnknown();
    all.allow(output.name);
  }
  all.rejectUnknown();
}

/// What presses an input is in the units of its axis.
void readFlagOfRig(ConfigReader& reader, const std::vector<config::AxisConfig>& axes,
                   bool axes_are_right, SimulatedInput& own) {
  const auto axis = reader.findText("axis", Presence::kOptional);
  const auto found =
      std::find_if(axes.begin(), axes.end(), [&](const auto& any) { return any.name == axis; });
  if (axis && found == axes.end()) {
    reader.issue("axis",
                 fmt::format("is {}, but must be the name of an axis", reader.shown("axis")));
  }
  const bool is_known = axes_are_right && axis && found != axes.end();
  const bool is_linear = !is_known || found->kind == config::Kind::kLinear;
  const bool is_rotary = !is_known || found->kind == config::Kind::kRotary;
  const auto length = [&](const std::string& what, const Range& range, double& value,
                          Presence presence) {
    for (const auto& [unit, may] : {std::pair("_mm", is_linear), std::pair("_deg", is_rotary)}) {
      if (!may) continue;
      const auto number = reader.findNumber(what + unit, range, presence);
      if (number) value = *number;
    }
  };
  const Presence places = is_known ? Presence::kRequired : Presence::kOptional;
  length("from", Range{}, own.from, places);
  length("to", Range{}, own.to, places);
  length("every", Range::notNegative(), own.every, Presence::kOptional);
  length("hysteresis", Range::notNegative(), own.hysteresis, Presence::kOptional);
  if (!is_known) return;
  own.axis = *axis;
  if (own.from > own.to || (own.every != 0.0 && own.every <= own.to - own.from)) {
    reader.issue("",
                 fmt::format("is pressed from {} to {}, every {}: it must be from a lower place "
                             "to a higher one, and again after more than that, or 0",
                             roughText(own.from), roughText(own.to), roughText(own.every)));
  }
}

void readInputsOfRig(ConfigReader all, const std::vector<config::InputConfig>& inputs,
                     const std::vector<config::AxisConfig>& axes, bool axes_are_right,
                     SimulationConfig& config) {
  for (const config::InputConfig& input : inputs) {
    ConfigReader reader = all.map(input.name);
    SimulatedInput& own = config.inputs[input.name];
    own.pressed = reader.boolean("pressed", own.pressed);
    own.bounces = reader.integer("bounces", 0, kMostBounces, own.bounces);
    own.bounce_ms = reader.number("bounce_ms", Range{0.0, kLongestBounceMs, true}, own.bounce_ms);
    readFlagOfRig(reader, axes, axes_are_right, own);
    reader.rejectUnknown();
    all.allow(input.name);
  }
  all.rejectUnknown();
}

}  // namespace

SimulationConfig readSimulation(ConfigReader reader, const std::vector<config::AxisConfig>& axes,
                                bool axes_are_right,
                                const std::vector<config::OutputConfig>& outputs,
                                const std::vector<config::InputConfig>& inputs) {
  SimulationConfig config;
  config.speed = reader.number("speed", Range{0.0, kHighestSpeed}, config.speed);
  config.trace = reader.text("trace", config.trace);
  config.trace_overwrites_any_file =
      reader.boolean("trace_overwrites_any_file", config.trace_overwrites_any_file);
  config.emergency_stop = reader.boolean("emergency_stop", config.emergency_stop);
  ConfigReader rigs = reader.map("axes");
  for (const config::AxisConfig& axis : axes) {
    std::string unit;
    if (axes_are_right) unit = axis.kind == config::Kind::kLinear ? "mm" : "deg";
    config.axes[axis.name] =
        SimulatedAxisReader(rigs.map(axis.name), unit).readWithMotors(motorsOf(axis));
  }
  if (!axes.empty()) rigs.rejectUnknown();
  readOutputsOfRig(reader.map("outputs"), outputs, config);
  readInputsOfRig(reader.map("inputs"), inputs, axes, axes_are_right, config);
  reader.rejectUnknown();
  return config;
}

}  // namespace stepdriver::setup
