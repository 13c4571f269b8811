#include "search/participants.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>

#include "bus/open_port.h"
#include "driver/tmc_registers.h"
#include "guard/emergency_stops.h"
#include "motor/input_shaping.h"
#include "stepdriver_core/error.h"
#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/gantry_bench.h"
#include "support/tmc_axis.h"
#include "trajectory/path_plan.h"
#include "trajectory/queued_path.h"

namespace stepdriver::search {
namespace {

using test::kMillisecond;
constexpr pulse::Nanoseconds kSecond = 1'000 * kMillisecond;
constexpr pulse::Nanoseconds kWriteTimeout = 500 * kMillisecond;
constexpr pulse::Nanoseconds kInputPeriod = 100 * kMillisecond;
constexpr pulse::Nanoseconds kMaxLateness = 5 * kMillisecond;
/// The engine is at most this late; that is more than it can make up for.
constexpr pulse::Nanoseconds kLatestPass = 8 * kMillisecond;
/// A board that is late plays what is overdue as closely as the chips allow: its lateness is what a
/// motor can follow, two steps at the top speed.
constexpr pulse::Nanoseconds kLatestPlay = 500'000;
/// From the answer of a stop to the beginning of the deceleration, without and with a late engine
/// that refuses plans.
constexpr pulse::Nanoseconds kLead = 2 * kMillisecond;
constexpr pulse::Nanoseconds kLongestLead = 40 * kMillisecond;
constexpr const char* kEmergencyStop = "emergency_stop";
/// An output with a name.
constexpr const char* kTool = "tool";
constexpr const char* kComparesCam = "the position of y switches the tool";
constexpr const char* kComparesPulses = "the position of y makes pulses of the tool";
/// [m] A position of y can switch it, on in here: as far as a move takes the axis.
constexpr config::PositionCompare::Cam kToolCam{-0.001, 0.001};
/// Or it makes pulses there: at each of these places.
constexpr double kPulseEvery = 0.001;  // m
constexpr pulse::Nanoseconds kPulse = 6 * kMillisecond;
/// That is y.
constexpr std::size_t kCompared = 1;
/// [m] No step is lost, but one may be late.
constexpr double kFlagTolerance = 0.0005;
/// An input with a name, which the carriage of x presses between two places. [mm]
constexpr const char* kProbeInput = "probe";
/// One that the carriage of z presses in passing, at this place. [mm]
constexpr const char* kIndexInput = "index";
constexpr double kIndexAt = 5.0;
/// One that is active while a block stops x.
constexpr const char* kBlockInput = "block";
/// [mm] Where the switches are.
constexpr double kMinAt = -9.0;
constexpr double kMaxAt = 16.0;
constexpr double kPressedFrom = 3.0;
constexpr double kPressedTo = 12.0;
/// How often a client looks whether a stroke of its probing has ended.
constexpr pulse::Nanoseconds kProbeLook = 5 * kMillisecond;
/// [m/s] The touches.
constexpr double kFirstTouch = 0.05;
constexpr double kSecondTouch = 0.01;
/// The period of a stream of jogs, and their number.
constexpr pulse::Nanoseconds kJogPeriod = 10 * kMillisecond;
constexpr int kJogs = 12;
constexpr pulse::Nanoseconds kLongestCall = 120 * kSecond;
/// From the loss of the motor power to the last step, if an edge is lost and the engine is late.
constexpr pulse::Nanoseconds kLossIsSeen = kInputPeriod + 2 * kLatestPass;
constexpr pulse::Nanoseconds kQuietIsWatched = 250 * kMillisecond;
/// The watcher is at most this late.
constexpr pulse::Nanoseconds kLatestWatch = kSecond;
constexpr std::size_t kMostSteps = 200'000;
/// [microsteps] A motion may be outside of its hull by one, and half of one is between a target and
/// the place nearest to it. Motors that axes share step one after the other.
constexpr double kHullTolerance = 1.51;
/// The load of an axis with a brake falls at this speed. [mm/s]
constexpr double kLoadFalls = 20.0;
/// How far the second motor of an axis is ahead at the start. [mm]
constexpr double kRacked = 1.5;

/// An access to a register at 115200 baud, and one that nobody answers.
constexpr pulse::Nanoseconds kAccess = 3 * kMillisecond;
constexpr pulse::Nanoseconds kSilence = 90 * kMillisecond;
/// Each trouble of a chip is known after this time.
constexpr pulse::Nanoseconds kTroubleIsKnown = 1'500 * kMillisecond;
/// [mm] Where a block stops x if it is homed against it: it has no min switch.
constexpr double kBlock = kMinAt;

/// In this variant x and y share their motors, as on a CoreXY.
constexpr int kSharing = 3;
/// In this one the motions of x and z are shaped, and those of y aren't.
constexpr int kShaped = 4;

bool hasRegisters(const std::vector<config::AxisConfig>& configs) {
  return configs.front().tmc.has_value();
}

constexpr int kHalfSteps = 2;

bool hasPhases(const config::AxisConfig& config) {
  return config.driver.step_inputs == driver::StepInputs::kPhases;
}

bool meetsBlock(const config::AxisConfig& config) {
  return config.homing && (config.homing->kind == config::HomingKind::kStall ||
                           config.homing->kind == config::HomingKind::kBlock);
}

int microstepsOf(std::uint32_t chopconf) {
  return driver::tmc::kFinest >> (chopconf >> driver::tmc::kMresShift & 0xFU);
}

/// x of kRegisters.
config::AxisConfig axisWithRegisters() {
  config::AxisConfig config = test::tmcAxis("x");
  config.acceleration = config.deceleration = 2.0;
  config.endstop_min.reset();
  config.min_position = kBlock / 1e3 + 0.0005;
  config.fault = config::FaultPin{"x.fault"};
  config.align_on_microstep_change = true;
  config.idle_timeout = 0.05;
  config.idle_action = config::IdleAction::kLowerCurrent;
  config.tmc->idle_current = 0.1;
  config.tmc->stall.emplace();
  config.tmc->stall->threshold = 100;
  config.tmc->stall->current = 0.7;
  config.homing.emplace();
  config.homing->kind = config::HomingKind::kStall;
  config.homing->seek_speed = 0.05;
  config.homing->pull_off = 0.004;
  config.homing->offset = kBlock / 1e3;
  config.homing->max_travel = 0.04;
  return config;
}

/// The motors and switches of kPhases.
void makePhases(std::vector<config::AxisConfig>& configs) {
  config::AxisConfig& x = configs[0];
  x.endstop_min.reset();
  x.min_position = kBlock / 1e3 + 0.0005;
  x.homing->kind = config::HomingKind::kBlock;
  x.homing->input = kBlockInput;
  x.homing->approaches = 2;
  x.homing->pull_off = 0.002;
  config::AxisConfig& y = configs[1];
  y.driver = driver::driverChip("uln2003");
  y.microsteps = kHalfSteps;
  y.pins = {};
  y.pins.in1.line = "y.in1";
  y.pins.in2.line = "y.in2";
  y.pins.in3.line = "y.in3";
  y.pins.in4.line = "y.in4";
  y.fault.reset();
  y.homing->kind = config::HomingKind::kLimit;
  config::AxisConfig& z = configs[2];
  z.homing->kind = config::HomingKind::kLimit;
  z.homing->input.clear();
  z.homing->offset = kMaxAt / 1e3;
  z.homing->order = 2;
  z.switch_release = 0.001;
  for (auto* endstop : {&y.endstop_min, &z.endstop_min, &z.endstop_max}) {
    (*endstop)->line = "ends";
    (*endstop)->shared = true;
  }
}

}  // namespace

std::vector<config::AxisConfig> configsOf(int variant) {
  std::vector<config::AxisConfig> configs;
  for (const char* name : {"x", "y", "z"}) {
    config::AxisConfig config = test::linearAxis(name, 20'000.0, 0.1, 2.0);
    config.steps_per_round = 100.0;
    config.fault = config::FaultPin{config.name + ".fault"};
    config.driver.fault_end = driver::FaultEnd::kReset;
    configs.push_back(config);
  }
  config::HomingConfig homing;
  homing.seek_speed = 0.05;
  homing.latch_speed = 0.02;
  homing.pull_off = 0.001;
  homing.offset = -0.009;
  homing.max_travel = 0.04;
  if (variant == 1 || variant == kShaped) {
    homing.kind = variant == 1 ? config::HomingKind::kFlag : config::HomingKind::kFlagCentre;
    homing.input = kProbeInput;
    // Behind the probe there are 4 mm to slow down in, which a shaper makes longer.
    homing.seek_speed = 0.02;
    homing.latch_speed = 0.01;
    homing.offset = kPressedFrom / 1e3;
    homing.check_at_flag = config::FlagCheck::kFault;
    homing.flag_tolerance = kFlagTolerance;
  }
  configs[0].homing = homing;
  homing.check_at_flag = config::FlagCheck::kNone;
  homing.kind = config::HomingKind::kDirect;
  configs[1].homing = homing;
  configs[1].homing->order = 1;  // the motors of x may be its own too
  homing.kind = config::HomingKind::kIndex;
  homing.input = kIndexInput;
  homing.at_max = true;
  homing.offset = kIndexAt / 1e3;
  configs[2].homing = homing;
  configs[1].backlash = 0.0004;
  configs[1].align_on_microstep_change = true;
  configs[2].jerk = 50.0;
  configs[2].idle_timeout = 0.03;
  configs[2].driver.in_position_active = true;
  configs[2].in_position = config::InPositionPin{"z.in_position", Bias::kAsIs, 0.05};
  if (variant == kRegisters) configs[0] = axisWithRegisters();
  if (variant == kPhases) makePhases(configs);
  if (variant != 1 && variant != kPhases) {
    configs[0].pins.enable.line = configs[1].pins.enable.line = "both.enable";
  }
  // It may jump by full steps, onto a switch of which nobody knows the end.
  if (variant != 0 && variant != kPhases) configs[2].idle_action = config::IdleAction::kSleep;
  if (variant == 1) {
    configs[0].driver.fault_end = driver::FaultEnd::kEnable;
    configs[0].fault_ramps = true;
  }
  const auto add_brake = [](config::AxisConfig& config) {
    config.brake =
        config::BrakeConfig{config.name + ".brake", true, 6 * kMillisecond, 4 * kMillisecond};
  };
  if (variant == 1 || variant == 2) add_brake(configs[0]);
  if (variant == kSharing) {
    configs[1].backlash = 0.0;
    std::vector<config::AxisConfig> sharing(configs.begin(), configs.begin() + 2);
    test::share(sharing, {{1.0, 1.0}, {1.0, -1.0}});
    for (std::size_t i = 0; i < sharing.size(); ++i) configs[i].kinematics = sharing[i].kinematics;
  }
  if (variant == kShaped) {
    // Parts of two such shapers that cancel each other out have made bursts of steps.
    configs[0].input_shaper = {{config::ShaperType::kZv, 7.0, 0.0},
                               {config::ShaperType::kZv, 14.0, 0.0}};
    configs[0].jerk = 50.0;
    configs[2].input_shaper = {{config::ShaperType::kEi, 40.0, 0.05}};
  }
  if (variant == 2) {
    add_brake(configs[2]);
    config::MotorConfig right = test::motorNamed("right");
    right.pins.enable.line = configs[0].pins.enable.line;
    right.fault = config::FaultPin{"right.fault"};
    configs[0].motor = "left";
    configs[0].twins.push_back(right);
    configs[0].max_skew = 0.004;
  }
  return configs;
}

namespace {

machine::EmergencyDisable emergencyDisableOf(int variant) {
  switch (variant) {
    case 1:
    case kShaped:
      return machine::EmergencyDisable::kRamp;
    case 2:
    case kPhases:
      return machine::EmergencyDisable::kOff;
    default:
      return machine::EmergencyDisable::kHold;
  }
}

machine::MachineOptions optionsOf(int variant) {
  machine::MachineOptions options;
  options.emergency_stop = config::InputSwitch{kEmergencyStop, true};
  options.emergency_disable = emergencyDisableOf(variant);
  if (variant == 1 || variant == kPhases) {
    options.motor_power = config::MotorPowerConfig{};
    options.motor_power->line = "power";
    options.motor_power->on_ns = 15 * kMillisecond;
    options.motor_power->off_delay_ns = 10 * kMillisecond;
    options.motor_power->feedback = config::InputSwitch{"power.feedback", true};
    options.motor_power->feedback_timeout_ns = 50 * kMillisecond;
  }
  config::OutputConfig tool;
  tool.name = kTool;
  tool.line = kTool;
  tool.active_level = variant != 1;
  tool.min_on_ns = 5 * kMillisecond;
  tool.at_fault = variant == 2;
  if (variant == 0) tool.at_stop = false;
  if (variant == kSharing) tool.max_on_ns = 20 * kMillisecond;
  options.outputs.push_back(tool);
  config::InputConfig probe;
  probe.name = kProbeInput;
  probe.line = {kProbeInput, true, Bias::kAsIs};
  if (variant == 2) probe.debounce_ns = 2 * kMillisecond;
  options.inputs.push_back(probe);
  config::InputConfig index;
  index.name = kIndexInput;
  index.line = {kIndexInput, true, Bias::kAsIs};
  options.inputs.push_back(index);
  if (variant == kPhases) {
    config::InputConfig block;
    block.name = kBlockInput;
    block.line = {kBlockInput, true, Bias::kAsIs};
    options.inputs.push_back(block);
  }
  return options;
}

/// The schedule lets a participant be late.
bool isLate(const Schedule& schedule, Who who) {
  return std::any_of(schedule.deviations.begin(), schedule.deviations.end(),
                     [who](const Deviation& deviation) { return deviation.who == who; });
}

bool isEngineLate(const Schedule& schedule) { return isLate(schedule, Who::kEngine); }

/// Drawn machines may be fast.
pulse::Nanoseconds latestPlayOf(const Schedule& schedule) {
  return isLate(schedule, Who::kBoard) && schedule.machine.empty() ? kLatestPlay : 0;
}

/// From when steps are taken back until the last one that is played.
pulse::Nanoseconds takingBack(const Schedule& schedule) {
  if (!schedule.ahead) return 0;
  return schedule.ahead->take_back + latestPlayOf(schedule) +
         (isEngineLate(schedule) ? kLatestPass : 0);
}

/// By how much the last step of a motion is later than with a GpioPort.
pulse::Nanoseconds aheadOf(const Schedule& schedule) {
  if (!schedule.ahead) return 0;
  return schedule.ahead->horizon + std::max<pulse::Nanoseconds>(schedule.ahead->late, 0) +
         latestPlayOf(schedule);
}

/// [microsteps, as configured] By so many steps a late engine may be behind without a slip of the
/// timeline.
double lateStepsOf(const config::AxisConfig& config) {
  return machine::MachineOptions().late_steps * config.microsteps;
}

std::vector<sim::RigAxisSpec> rigOf(const std::vector<config::AxisConfig>& configs,
                                    const Schedule& schedule) {
  std::vector<sim::RigAxisSpec> specs;
  for (std::size_t axis = 0; axis < configs.size(); ++axis) {
    const config::AxisConfig& config = configs[axis];
    for (sim::RigAxisSpec& spec : test::rigMotors(config)) {
      if (spec.min_switch) spec.min_switch->position = kMinAt;
      spec.max_switch->position = kMaxAt;
      spec.settling_ns = 5 * kMillisecond;
      if (config.brake) spec.load_falls = kLoadFalls;
      if (spec.name == configs[0].name) {
        sim::SwitchSpec probe;
        probe.line = kProbeInput;
        probe.active_level = true;
        probe.position = kPressedFrom;
        probe.end = kPressedTo;
        spec.flags.push_back(probe);
      }
      if (axis == 2) {
        sim::SwitchSpec index;
        index.line = kIndexInput;
        index.active_level = true;
        index.position = kIndexAt;
        index.end = kIndexAt + 0.1;
        spec.flags.push_back(index);
      }
      if (spec.name != config.name) spec.start = kRacked;
      spec.limits = setup::motorLimits(configs, axis);
      if (meetsBlock(config)) spec.block_min = kBlock;
      if (meetsBlock(config) && !config.tmc) spec.stall_line = kBlockInput;
      if (config.tmc) {
        spec.motor = sim::soundMotor({}, spec.limits->rate / config.microsteps,
                                     spec.limits->acceleration / config.microsteps);
      }
      if (isEngineLate(schedule) || latestPlayOf(schedule) > 0) {
        spec.limits->late = lateStepsOf(config);
      }
      specs.push_back(spec);
    }
  }
  return specs;
}

std::vector<std::string> namesOf(const std::vector<config::AxisConfig>& configs) {
  std::vector<std::string> names;
  names.reserve(configs.size());
  for (const config::AxisConfig& config : configs) names.push_back(config.name);
  return names;
}

/// [s] A drawn machine may stop in less time than its next whole step takes, in the coarsest mode
/// and from the lowest speed: it speeds up to that step at most to its top speed.
double timeOfFullStep(const config::AxisConfig& config) {
  const double step = config.microsteps / config.steps_per_unit;
  double time = step / config.max_speed +
                std::sqrt(2.0 * step * (1.0 / config.acceleration + 1.0 / config.deceleration));
  if (config.jerk > 0.0) time += 4.0 * std::cbrt(0.5 * step / config.jerk);
  return time;
}

/// No port that takes steps ahead of time switches coils.
Schedule playable(Schedule schedule) {
  if (schedule.variant == kPhases) schedule.ahead.reset();
  return schedule;
}

/// For each axis, the longest deceleration and 10 %, and the time of its shaper.
std::array<Slowing, kAxes> slowingOf(const std::vector<config::AxisConfig>& configs,
                                     const Schedule& schedule) {
  const bool late = isEngineLate(schedule);
  std::array<Slowing, kAxes> slowing{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const config::AxisConfig& config = configs[axis];
    const double deceleration = config.stop_deceleration.value_or(config.deceleration);
    double time = config.max_speed / deceleration;
    if (config.jerk > 0.0) time += (deceleration + config.acceleration) / config.jerk;
    time *= 1.1;
    if (!schedule.machine.empty()) time += timeOfFullStep(config);
    slowing[axis] = {std::llround(time * 1e9) + (late ? kLongestLead : kLead) + aheadOf(schedule),
                     std::llround(motor::shapingTimeOf(config) * 1e9)};
  }
  return slowing;
}

/// A sentence that ends where its reason should stand says no more than an empty one.
bool givesNoReason(const std::string& text) {
  return text.empty() || text.back() == ' ' || text.back() == ':';
}

}  // namespace

const char* nameOf(Who who) {
  static const std::array<const char*, kParticipants> names = {
      "news",    "pin done", "input",    "request", "timer", "engine", "writer",
      "watcher", "client A", "client B", "clock",   "board", "bus",    "bus done"};
  return names.at(static_cast<std::size_t>(who));
}

Participants::Participants(const Schedule& schedule)
    : schedule_(playable(schedule)),
      configs_(schedule.machine.empty() ? configsOf(schedule.variant) : schedule.machine),
      oracle_(slowingOf(configs_, schedule_), [this] { return engine_->state().slipped; }),
      trace_(std::make_shared<RiseWatch>(namesOf(configs_))),
      rig_(rigOf(configs_, schedule_), trace_, test::Bench::couplings(configs_),
           test::Bench::motorPowerOf(optionsOf(schedule.variant)),
           test::Bench::ioOf(optionsOf(schedule.variant))),
      backend_(rig_, [this] { return clock_.now(); }),
      wiring_(configs_, optionsOf(schedule.variant)),
      lines_(std::make_shared<FailingReads>(backend_.request(wiring_.outputs, wiring_.inputs))) {
  axis::LineNames names;
  for (const gpio::OutputRequest& output : wiring_.outputs) names.outputs.push_back(output.line);
  for (const gpio::InputRequest& input : wiring_.inputs) names.inputs.push_back(input.line);
  if (const auto& ahead = schedule_.ahead) {
    const auto late = [by = ahead->late](const pulse::StepPort::Step&) { return by; };
    port_ = std::make_unique<test::AheadPort>(
        *lines_, clock_, pulse::PulseEngine::lanesOf(wiring_.channels, wiring_.shared),
        test::AheadPort::Habits{ahead->horizon, late, ahead->take_back});
    engine_ =
        std::make_unique<pulse::PulseEngine>(*port_, *lines_, clock_, wiring_.channels,
                                             kMaxLateness, wiring_.emergency_stop, wiring_.shared);
    oracle_.takesBack(takingBack(schedule_));
  } else {
    engine_ = std::make_unique<pulse::PulseEngine>(*lines_, clock_, wiring_.channels, kMaxLateness,
                                                   wiring_.emergency_stop, wiring_.shared);
  }
  engine_->switchOutputs(wiring_.switchedOutputs(optionsOf(schedule.variant)));
  tool_level_ = optionsOf(schedule.variant).outputs.front().level(true);
  if (schedule.variant == kSharing) oracle_.share({0, 1});
  controller_ = std::make_unique<machine::Controller>(
      configs_, wiring_.motor_lines, std::move(names), wiring_.emergency_stop,
      emergencyDisableOf(schedule.variant), wiring_.motorPower(optionsOf(schedule.variant)),
      wiring_.namedLines(optionsOf(schedule.variant)), engine_->horizon());
  if (ramps()) engine_->rampStops(machine::longestRamp(configs_));
  core_ = std::make_unique<machine::ShellCore>(*controller_, *engine_, clock_, lines_,
                                               wiring_.inputs.size(), static_cast<Host&>(*this),
                                               nullptr);
  news_ = std::make_unique<News>(*core_);
  engine_->listen(*news_);
  watched_ = readInputs();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (hasPhases(configs_[axis])) trace_->hasPhases(axis);
  }
  if (hasRegisters(configs_)) {
    trace_->setMicrosteps(0, configs_[0].microsteps);
    const config::TmcConfig& tmc = *configs_[0].tmc;
    registers_ = bus::openPort(
        tmc.port, tmc.baud,
        [this, port = tmc.port](const std::uint8_t* bytes, std::size_t count, bool pause) {
          return rig_.onBytes(port, bytes, count, pause, clock_.now());
        });
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    hulls_[axis].begin(0.0, kHullTolerance * roundingOf(axis));
    lowest_limits_[axis].deceleration = configs_[axis].deceleration;
    lowest_limits_[axis].jerk = configs_[axis].jerk;
  }
  trace_->rose = [this](std::size_t axis, std::int64_t time) {
    // Coils that are switched off beside one that can't be written may look like a step.
    if (hasPhases(configs_[axis]) && steps_failed_[axis]) return;
    oracle_.rose(axis, time);
    checkPowered(axis, time);
    passes(axis);
  };
}

// ---- the shell ----

void Participants::turnEnded(const machine::MachineSnapshot& /*before*/,
                             const std::shared_ptr<const machine::MachineSnapshot>& now,
                             activity::Outputs& out) {
  for (auto& [call, reply] : out.answers) answer(call, std::move(reply));
  for (const machine::AxisSnapshot& axis : now->axes) {
    const bool is_lost = axis.state.fault.find("lost steps") != std::string::npos;
    if (is_lost && !edges_were_lost_) oracle_.complain("no step was lost: " + axis.state.fault);
  }
  if (out.clear_stops != 0) engine_reads_inputs_ = true;
  for (const pulse::Command& command : out.commands) {
    for (std::size_t i = 0; i < command.follow_count; ++i) {
      const pulse::Follow& follow = command.follows[i];
      // Where a late step would move the place that a homing measures.
      const auto channel = static_cast<std::size_t>(follow.channel);
      const bool is_homed = now->axes[channel].state.homing != axis::HomingPhase::kNone;
      if (is_homed && follow.full_step != 0) {
        oracle_.complain(configs_[channel].name + " may make late steps while it is homed");
      }
      ordered_.at(channel).push_back({follow.serial, follow.group != 0});
    }
  }
  if (hasRegisters(configs_)) noteTrouble();
}

void Participants::write(const activity::PinJob& job) {
  Job written;
  written.job = job;
  written.deadline = clock_.now() + kWriteTimeout;
  written.returns = clock_.now() + std::exchange(next_pin_hang_, 0);
  written.error = std::exchange(next_pin_error_, 0);
  pins_failed_ = pins_failed_ || written.error != 0 || written.returns != clock_.now();
  jobs_.push_back(written);
}

void Participants::access(const bus::RegisterJob& job) {
  Access begun;
  begun.job = job;
  if (accesses_.empty()) begun.due = clock_.now() + kAccess;
  accesses_.push_back(std::move(begun));
}

// The next access of the job whose turn it is. What its chip doesn't answer takes longer.
void Participants::accessRegister() {
  Access& access = accesses_.front();
  if (!access.ended) {
    const bus::RegisterAccess& next = access.job.accesses[access.next++];
    bus::RegisterJob one = access.job;
    one.accesses = {next};
    const bus::RegisterDone done = bus::carryOut(one, *registers_, {});
    const bool failed = done.failure != bus::Failure::kNone;
    access.done.failure = done.failure;
    access.done.failed_number = done.failed_number;
    access.done.found = done.found;
    access.done.values.insert(access.done.values.end(), done.values.begin(), done.values.end());
    access.ended = failed || access.next == access.job.accesses.size();
    access.due = clock_.now() + (failed ? kSilence : kAccess);
    const bool sets_mode =
        next.number == driver::tmc::kChopconf && next.kind == bus::RegisterAccess::Kind::kWriteBack;
    if (!failed && sets_mode) trace_->setMicrosteps(0, microstepsOf(next.value));
    if (!access.ended || failed) return;
  }
  access.done.id = access.job.id;
  accesses_done_.push_back(access.done);
  accesses_.pop_front();
  if (!accesses_.empty()) accesses_.front().due = clock_.now() + kAccess;
}

void Participants::answer(std::uint64_t call, activity::Reply reply) {
  const auto found = open_.find(call);
  if (found == open_.end()) {
    oracle_.complain("call " + std::to_string(call) + " (" + answered_[call] +
                     ") is answered twice");
    return;
  }
  const Ask asked = std::move(found->second);
  open_.erase(found);
  answered_[call] = asked.name;
  note("answer of " + asked.name +
       (reply.failure ? ": " + reply.failure->text : std::string(": done")));
  if (reply.failure && givesNoReason(reply.failure->text)) {
    oracle_.complain(asked.name + " fails without a reason: " + reply.failure->text);
  }
  std::array<bool, kAxes> at_fault{};
  const auto snapshot = controller_->snapshot();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    at_fault[axis] = !snapshot->axes[axis].state.fault.empty();
  }
  if (const auto* refusals = std::get_if<activity::Refusals>(&reply.value)) {
    noteRefusals(call, asked, *refusals);
  }
  oracle_.answered(call, !reply.failure, clock_.now(), at_fault);
  if (!reply.failure && (asked.name == kComparesPulses || asked.name == kComparesCam)) {
    compares_pulses_ = asked.name == kComparesPulses;
  }
  if (!reply.failure && asked.meaning.quiet == Meaning::Quiet::kSlowsDown) checkSlowing(asked);
  const auto* moves = std::get_if<std::vector<axis::Move>>(&reply.value);
  if (!reply.failure && asked.enables) checkEnabled(asked);
  if (!reply.failure && !asked.goals.empty()) {
    checkMoves(asked, moves != nullptr ? *moves : std::vector<axis::Move>());
  }
  if (moves != nullptr && !reply.failure) {
    for (const axis::Move& move : *moves) {
      moves_.emplace_back(asked.name, move);
      if (!move.outcome) oracle_.complain(asked.name + " has no outcome");
    }
    std::size_t next = 0;
    for (std::size_t axis = 0; axis < kAxes && next < moves->size(); ++axis) {
      if (asked.meaning.axes[axis]) last_move_[axis] = (*moves)[next++].id;
    }
    for (std::size_t i = 0; i < asked.goals.size() && i < moves->size(); ++i) {
      const std::size_t axis = asked.goals[i];
      const double rest = onRig(axis, (*moves)[i].rest);
      const double overshoot = (*moves)[i].overshoot * configs_[axis].steps_per_unit;
      hulls_[axis].allow(rest - overshoot, rest + overshoot);
    }
  }
  if (const auto* homing = std::get_if<activity::AcceptedHoming>(&reply.value)) {
    homings_.push_back(*homing);
  }
  Client& client = clients_.at(static_cast<std::size_t>(asked.client));
  if (client.waits_for != call) return;
  client.waits_for = 0;
  if (client.on_answer) std::exchange(client.on_answer, nullptr)(reply);
  pauseBeforeTurn(client);
}

// A message for several axes, of which some may be refused.
void Participants::noteRefusals(std::uint64_t call, const Ask& asked,
                                const activity::Refusals& refusals) {
  for (std::size_t i = 0; i < refusals.size(); ++i) {
    if (refusals[i].empty()) continue;
    note("refused in part: " + refusals[i]);
    oracle_.refused(call, asked.parts.at(i), clock_.now());
  }
}

std::vector<int> Participants::readInputs() {
  std::vector<int> levels;
  levels.reserve(wiring_.inputs.size());
  for (int input = 0; input < static_cast<int>(wiring_.inputs.size()); ++input) {
    levels.push_back(lines_->read(input));
  }
  return levels;
}

// ---- steps ----

bool Participants::canGo(Who who) {
  const auto has_next = [this](std::size_t client) {
    const Client& own = clients_[client];
    if (own.next || hasTurn(own)) return clock_.now() >= own.from;
    return script_ && itemReady() && schedule_.items[next_item_].client == static_cast<int>(client);
  };
  switch (who) {
    case Who::kNews:
      return core_->hasNews();
    case Who::kPinDone:
      return !pins_done_.empty();
    case Who::kInput:
      return core_->hasInput();
    case Who::kRequest:
      return !requests_.empty();
    case Who::kTimer:
      return clock_.now() >= core_->dueWithPolls();
    case Who::kBus:
      return !accesses_.empty() && clock_.now() >= accesses_.front().due;
    case Who::kBusDone:
      return !accesses_done_.empty();
    case Who::kEngine:
      return engineIsDue();
    case Who::kBoard:
      return boardIsDue();
    case Who::kWriter:
      return !jobs_.empty() && (jobs_.front().returns <= clock_.now() ||
                                std::any_of(jobs_.begin(), jobs_.end(), [this](const Job& job) {
                                  return !job.told && job.deadline <= clock_.now();
                                }));
    case Who::kWatcher: {
      if (watch_due_ != pulse::kNever) return clock_.now() >= watch_due_;
      if (clock_.now() >= core_->edgesDue()) return true;
      return readInputs() != watched_;
    }
    case Who::kClientA:
      return has_next(0);
    case Who::kClientB:
      return has_next(1);
    case Who::kClock:
      return nextDue() != pulse::kNever;
  }
  return false;
}

bool Participants::isDelayed(Who who) const {
  if (!script_) return false;
  const std::size_t at = steps_ - script_began_;
  return std::any_of(schedule_.deviations.begin(), schedule_.deviations.end(),
                     [&](const Deviation& deviation) {
                       return deviation.who == who && at >= deviation.from &&
                              at - deviation.from < deviation.steps;
                     });
}

bool Participants::step() {
  static constexpr std::array<Who, kParticipants> turns = {
      Who::kNews,  Who::kPinDone, Who::kBusDone, Who::kInput, Who::kRequest,
      Who::kTimer, Who::kEngine,  Who::kWriter,  Who::kBus,   Who::kWatcher,
      Who::kBoard, Who::kClientA, Who::kClientB, Who::kClock};
  std::optional<Who> late;
  for (const Who who : turns) {
    if (!canGo(who)) continue;
    if (isDelayed(who)) {
      if (!late) late = who;
      continue;
    }
    go(who);
    return true;
  }
  if (!late && script_ && next_item_ < schedule_.items.size() &&
      clients_[static_cast<std::size_t>(schedule_.items[next_item_].client)].idle()) {
    beginItem();  // no event can come that it could wait for
    return true;
  }
  if (!late) return false;
  go(*late);
  return true;
}

void Participants::go(Who who) {
  act(who);
  trace_->settle();
  answerEmergencyStops();
  constexpr std::size_t kCheckedOnceIn = 101;
  if (steps_ % kCheckedOnceIn == 0) checkLive();
}

void Participants::answerEmergencyStops() {
  for (Client& client : clients_) {
    if (!client.waits_for_stops) continue;
    if (core_->snapshot()->stops_concluded < *client.waits_for_stops) continue;
    client.waits_for_stops.reset();
    pauseBeforeTurn(client);
    if (engine_->stopsAsked() == engine_->stopsServed()) {
      oracle_.emergencyStopAnswered(clock_.now());
    }
    note("answer of emergency stop");
    checkOutputs();
  }
}

// Until somebody recovers from it.
void Participants::checkOutputs() {
  if (!engine_->emergencyStopped() || pins_failed_) return;
  for (const config::OutputConfig& output : optionsOf(schedule_.variant).outputs) {
    if (rig_.outputLevel(output.line) == output.level(output.at_fault)) continue;
    oracle_.complain("the output " + output.name + " is not in its safe state when an emergency " +
                     "stop is answered");
  }
}

void Participants::act(Who who) {
  ++steps_;
  if (log_ && who != Who::kEngine && who != Who::kClock && who != Who::kBoard) note(nameOf(who));
  switch (who) {
    case Who::kNews:
      core_->takeNews();
      return;
    case Who::kPinDone: {
      const activity::PinDone done = pins_done_.front();
      pins_done_.pop_front();
      return core_->handle(done);
    }
    case Who::kBusDone: {
      const bus::RegisterDone done = accesses_done_.front();
      accesses_done_.pop_front();
      return core_->handle(done);
    }
    case Who::kInput:
      core_->takeInput();
      return;
    case Who::kRequest: {
      while (core_->takeInput()) {
      }
      Ask asked = std::move(requests_.front());
      requests_.pop_front();
      oracle_.served(asked.id, asked.name, asked.meaning);
      noteServed(asked);
      core_->takeRequest();
      return;
    }
    case Who::kTimer:
      core_->takeTime();
      return;
    case Who::kEngine:
      return serveEngine();
    case Who::kWriter:
      return writeLines();
    case Who::kWatcher:
      return watch();
    case Who::kClientA:
    case Who::kClientB: {
      const int number = who == Who::kClientA ? 0 : 1;
      Client& client = clients_[static_cast<std::size_t>(number)];
      if (client.next) return std::exchange(client.next, nullptr)();
      return hasTurn(client) ? beginTurn(number) : beginItem();
    }
    case Who::kClock:
      return advanceTo(nextDue());
    case Who::kBoard:
      return port_->play(clock_.now());
    case Who::kBus:
      return accessRegister();
  }
}

void Participants::serveEngine() {
  const bool reads = std::exchange(engine_reads_inputs_, false);
  clock_.woken = false;
  engine_waits_since_ = pulse::kNever;
  engine_due_ = engine_->serve();
  checkPulse();
  if (std::exchange(input_stops_, engine_->inputStops()) != input_stops_) {
    note("the emergency stop input is active");
    oracle_.emergencyStopped(clock_.now(), rampBegins());
  }
  if (reads && lines_->read(wiring_.emergency_stop->line) != 0 && !engine_->emergencyStopped()) {
    oracle_.complain("the emergency stop input is active, and the engine is not stopped");
  }
}

void Participants::writeLines() {
  if (jobs_.front().returns <= clock_.now()) {
    const Job job = jobs_.front();
    jobs_.pop_front();
    // Writes that have waited behind a hanging write are dropped; the hanging write itself is done
    // late.
    const bool hung = job.told && job.returns > job.deadline;
    int error = job.error;
    const gpio::LineWrite line{job.job.output, job.job.level};
    if (error == 0 && (!job.told || hung)) error = lines_->write(&line, 1);
    if (!job.told) pins_done_.push_back({job.job.id, error});
    // The writes behind it begin now.
    if (!jobs_.empty()) jobs_.front().returns = std::max(jobs_.front().returns, clock_.now());
    return;
  }
  for (Job& job : jobs_) {
    if (job.told || job.deadline > clock_.now()) continue;
    job.told = true;
    pins_failed_ = true;
    pins_done_.push_back({job.job.id, ETIMEDOUT});
  }
}

void Participants::watch() {
  std::array<gpio::EdgeEvent, 16> events{};
  const pulse::Nanoseconds asked = clock_.now();
  const int count = lines_->waitForEdges(0, events.data(), events.size());
  if (loses_edges_) {
    loses_edges_ = false;
    watch_due_ = clock_.now() + kInputPeriod;
    return;
  }
  watch_due_ = pulse::kNever;
  engine_->inputsChanged();
  engine_reads_inputs_ = true;
  watched_ = readInputs();
  core_->watchInputs(events.data(), count, asked);
}

bool Participants::engineIsDue() { return clock_.woken || clock_.now() >= engine_due_; }

bool Participants::boardIsDue() { return port_ && port_->playDue() <= clock_.now(); }

// No time passes beyond it while the engine, the board or the watcher are kept waiting.
pulse::Nanoseconds Participants::latestTime() {
  pulse::Nanoseconds latest = pulse::kNever;
  if (engineIsDue()) latest = engine_waits_since_ + kLatestPass;
  if (canGo(Who::kWatcher)) latest = std::min(latest, watcher_waits_since_ + kLatestWatch);
  if (!boardIsDue()) return latest;
  const pulse::Nanoseconds due = std::min(port_->playDue(), port_->oldestStep());
  return std::min(latest, std::max(due + latestPlayOf(schedule_), clock_.now()));
}

pulse::Nanoseconds Participants::nextDue() {
  const pulse::Nanoseconds now = clock_.now();
  engine_waits_since_ = engineIsDue() ? std::min(engine_waits_since_, now) : pulse::kNever;
  watcher_waits_since_ = canGo(Who::kWatcher) ? std::min(watcher_waits_since_, now) : pulse::kNever;
  pulse::Nanoseconds due = pulse::kNever;
  const auto look = [&](pulse::Nanoseconds time) {
    if (time > now) due = std::min(due, time);
  };
  look(engine_due_);
  if (port_) look(port_->playDue());
  look(core_->dueWithPolls());
  if (!accesses_.empty()) look(accesses_.front().due);
  look(watch_due_);
  look(core_->edgesDue());
  for (const Client& client : clients_) {
    if (client.next || hasTurn(client)) look(client.from);
  }
  if (!jobs_.empty()) look(jobs_.front().returns);
  for (const Job& job : jobs_) {
    if (!job.told) look(job.deadline);
  }
  const pulse::Nanoseconds latest = latestTime();
  return now < latest ? std::min(due, latest) : pulse::kNever;
}

void Participants::advanceTo(pulse::Nanoseconds time) {
  while (clock_.now() < time) clock_.waitUntil(time);
}

void Participants::note(const std::string& what) {
  if (log_) {
    lines_of_log_.push_back(std::to_string(steps_ - script_began_) + " " +
                            std::to_string(clock_.now()) + " ns: " + what);
  }
}

// ---- clients ----

bool Participants::itemReady() const {
  if (next_item_ >= schedule_.items.size()) return false;
  const Item& item = schedule_.items[next_item_];
  return clients_[static_cast<std::size_t>(item.client)].idle() &&
         steps_ - item_step_ >= item.after;
}

void Participants::beginItem() {
  const Item item = schedule_.items[next_item_++];
  item_step_ = steps_;
  const Act& act = actOf(item);
  note("begin " + act.name);
  act.begin(*this, item.client);
}

void Participants::post(int client, const std::string& name, machine::Request request,
                        const Meaning& meaning) {
  Ask asked;
  asked.id = ++calls_;
  asked.client = client;
  asked.name = name;
  asked.meaning = meaning;
  // Motors that are shared are switched together.
  const bool switches = std::holds_alternative<machine::Enable>(request) ||
                        std::holds_alternative<machine::Sleep>(request);
  if (switches && schedule_.variant == kSharing) {
    bool& x = asked.meaning.axes[0];
    bool& y = asked.meaning.axes[1];
    x = y = x || y;
  }
  const auto* enable = std::get_if<machine::Enable>(&request);
  if (enable != nullptr && enable->on) asked.enables = enable->axes.front();
  asked.request = std::move(request);
  noteGoals(asked);
  asked.posted = clock_.now();
  asked.posted_step = steps_;
  open_[asked.id] = asked;
  open_[asked.id].request = machine::StopAll{};
  clients_[static_cast<std::size_t>(client)].waits_for = asked.id;
  if (const std::string why = core_->post(asked.id, asked.request); !why.empty()) {
    oracle_.complain(name + " isn't taken: " + why);
  }
  requests_.push_back(std::move(asked));
  if (std::holds_alternative<machine::SetPosition>(requests_.back().request) ||
      std::holds_alternative<machine::Home>(requests_.back().request)) {
    position_changed_ = true;
  }
}

// Notes the axes that the request gives a goal, and the distances.
void Participants::noteGoals(Ask& asked) {
  if (const auto* move = std::get_if<machine::MoveTo>(&asked.request)) {
    asked.goals = {move->axis};
    asked.relative = move->relative;
    asked.ways = {move->position};
  } else if (const auto* rounds = std::get_if<machine::MoveRounds>(&asked.request)) {
    const config::AxisConfig& config = configs_.at(rounds->axis);
    asked.goals = {rounds->axis};
    asked.relative = true;
    asked.ways = {rounds->rounds * config.steps_per_round / config.steps_per_unit};
  } else if (const auto* line = std::get_if<machine::MoveLine>(&asked.request)) {
    asked.goals = line->axes;
    asked.together = true;
    asked.relative = line->relative;
    asked.ways = line->positions;
  } else if (const auto* stroke = std::get_if<machine::ProbeStroke>(&asked.request)) {
    asked.goals = stroke->line.axes;
    asked.together = true;
    asked.relative = stroke->line.relative;
    asked.ways = stroke->line.positions;
  } else if (const auto* trajectory = std::get_if<machine::FollowTrajectory>(&asked.request)) {
    asked.goals = trajectory->axes;
    asked.together = true;
    asked.begins_later = trajectory->begins_ns > 0;
  } else if (const auto* jogs = std::get_if<machine::JogTogether>(&asked.request)) {
    for (const machine::Jog& jog : jogs->jogs) asked.parts.push_back(jog.axis);
  } else if (const auto* setpoints = std::get_if<machine::FollowSetpoints>(&asked.request)) {
    for (const auto& setpoint : setpoints->setpoints) asked.parts.push_back(setpoint.axis);
  }
}

// Now it is handed to the controller.
void Participants::noteServed(Ask& asked) {
  beginHulls(asked);
  for (const std::size_t axis : asked.goals) {
    for (const std::size_t other : asked.goals) together_[axis][other] |= asked.together;
  }
  if (const auto* set = std::get_if<machine::SetLimits>(&asked.request)) noteLimits(*set);
  const auto found = open_.find(asked.id);
  close_was_served_ |= std::holds_alternative<machine::Close>(asked.request);
  if (found == open_.end()) return;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    found->second.orders[axis] = ordered_[axis].size();
  }
  for (std::size_t i = 0; asked.relative && i < asked.goals.size(); ++i) {
    const std::optional<double> origin = relativeOrigin(asked.goals[i]);
    found->second.targets.push_back(origin ? std::optional(*origin + asked.ways[i]) : origin);
  }
  if (!std::holds_alternative<machine::FollowSetpoints>(asked.request)) return;
  for (const std::size_t axis : asked.parts) had_setpoints_[axis] = true;
}

// The position at which the joint will come to rest from its present state; no value if that is
// unknown.
std::optional<double> Participants::relativeOrigin(std::size_t axis) {
  const auto snapshot = controller_->snapshot();
  const machine::AxisSnapshot& now = snapshot->axes.at(axis);
  if (!now.state.moving) return now.memory.position;
  // It may count from a setpoint, before which the timeout stops the axis.
  if (had_setpoints_[axis]) return std::nullopt;
  const machine::AxisSnapshot::Motion& last = now.motions.back();
  if (!last.target && !last.slows_down) return std::nullopt;
  // Each turn on the way takes up the backlash again. The motor turns by whole microsteps.
  std::int64_t motor = now.channel.count;
  std::int64_t slack = now.channel.slack;
  const auto move_to = [&](motion::DoubleDouble position) {
    const std::int64_t count = std::llround(position.value());
    slack = std::clamp<std::int64_t>(slack + count - motor, 0, now.backlash);
    motor = count;
  };
  constexpr pulse::Nanoseconds kStep = 1'000'000;
  auto time = clock_.now() - engine_->state().slipped;
  for (std::size_t i = 0; i < now.motions.size(); ++i) {
    const motion::ShapedProfile made = now.motions[i].planned.made();
    const bool is_last = i + 1 == now.motions.size();
    const auto end = is_last ? made.endNs() : now.motions[i + 1].planned.made().startNs();
    for (; time < end; time += kStep) move_to(made.stateAt(time).position);
    if (is_last) move_to(made.endPosition());
  }
  return now.origin + static_cast<double>(motor - slack) / now.steps_per_unit;
}

// ---- the ways of the axes ----

double Participants::placeOnRig(std::size_t axis) const {
  const auto& shared = configs_[axis].kinematics;
  if (shared == nullptr) return static_cast<double>(trace_->place(axis));
  double place = 0.0;
  for (std::size_t motor = 0; motor < shared->axes.size(); ++motor) {
    place += shared->inverse[axis][motor] * static_cast<double>(trace_->place(motor)) /
             configs_[motor].steps_per_unit;
  }
  return place * configs_[axis].steps_per_unit;
}

// [configured microsteps] What the rig has seen and the engine hasn't heard of.
double Participants::untoldOf(std::size_t axis) const {
  if (!port_) return 0.0;
  const auto& shared = configs_[axis].kinematics;
  const auto scale = [this](std::size_t i) {
    return configs_[i].steps_per_unit / controller_->snapshot()->axes.at(i).steps_per_unit;
  };
  if (shared == nullptr) return static_cast<double>(port_->untold(axis)) * scale(axis);
  double untold = 0.0;
  for (std::size_t motor = 0; motor < shared->axes.size(); ++motor) {
    untold += shared->inverse[axis][motor] * scale(motor) *
              static_cast<double>(port_->untold(kAxes + motor)) / configs_[motor].steps_per_unit;
  }
  return untold * configs_[axis].steps_per_unit;
}

// [microsteps] By how much a microstep of each motor moves it.
double Participants::roundingOf(std::size_t axis) const {
  const auto& shared = configs_[axis].kinematics;
  if (shared == nullptr) return 1.0;
  double rounding = 0.0;
  for (std::size_t motor = 0; motor < shared->axes.size(); ++motor) {
    rounding += std::abs(shared->inverse[axis][motor]) / configs_[motor].steps_per_unit;
  }
  return std::max(1.0, rounding * configs_[axis].steps_per_unit);
}

double Participants::onRig(std::size_t axis, double position) {
  const auto snapshot = controller_->snapshot();
  const pulse::ChannelState live = engine_->channel(static_cast<int>(axis));
  const axis::AxisState now =
      machine::stateOf(snapshot->axes.at(axis), live, clock_.now(), clock_.now());
  const double told = placeOnRig(axis) - untoldOf(axis);
  return told + (position - now.position) * configs_[axis].steps_per_unit;
}

// Nothing that was asked before this call moves it any more, nor an axis that shares its motors:
// while such a one moves, the microsteps of the motors move both.
bool Participants::mayRest(std::size_t axis, std::uint64_t call) {
  const auto& shared = configs_[axis].kinematics;
  if (shared == nullptr) return mayRestAlone(axis, call);
  for (std::size_t sharer = 0; sharer < shared->axes.size(); ++sharer) {
    if (!mayRestAlone(sharer, call)) return false;
  }
  return true;
}

bool Participants::mayRestAlone(std::size_t axis, std::uint64_t call) {
  const auto snapshot = controller_->snapshot();
  const axis::AxisState& state = snapshot->axes.at(axis).state;
  if (waits_[axis] || state.moving || state.held || state.homing != axis::HomingPhase::kNone) {
    return false;
  }
  if (engine_->channel(static_cast<int>(axis)).following != 0 || core_->isHeldUp()) return false;
  return std::none_of(open_.begin(), open_.end(), [&](const auto& other) {
    const Meaning& meaning = other.second.meaning;
    return other.first != call && meaning.axes[axis] && (meaning.moves || meaning.resumes);
  });
}

// From the top speed, at the lowest limits that the axis ever had: each new setpoint is followed
// within those of its time.
double Participants::stoppingWay(std::size_t axis) const {
  const config::AxisConfig& config = configs_[axis];
  const axis::AxisLimits& lowest = lowest_limits_[axis];
  double time = 0.5 * config.max_speed / lowest.deceleration + motor::shapingTimeOf(config) +
                static_cast<double>(kLongestLead + aheadOf(schedule_)) * 1e-9;
  if (lowest.jerk > 0.0) time += (config.deceleration + config.acceleration) / lowest.jerk;
  return config.max_speed * time * config.steps_per_unit;
}

void Participants::noteLimits(const machine::SetLimits& set) {
  axis::AxisLimits& lowest = lowest_limits_.at(set.axis);
  const auto lower = [](double& limit, double wanted) {
    if (wanted > 0.0 && (limit == 0.0 || wanted < limit)) limit = wanted;
  };
  lower(lowest.deceleration, std::min(set.limits.deceleration, set.limits.acceleration));
  lower(lowest.jerk, set.limits.jerk);
  // Setpoints may be passed; a motion to a target keeps its limits if it would pass it otherwise.
  if (had_setpoints_[set.axis]) hulls_[set.axis].widen(stoppingWay(set.axis));
}

void Participants::passes(std::size_t motor) {
  const auto& shared = configs_[motor].kinematics;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const bool moves = axis == motor || (shared && configs_[axis].kinematics == shared);
    if (moves) hulls_[axis].pass(placeOnRig(axis));
  }
}

namespace {

// [s] All segments of a trajectory that is posted here take as long as its first.
double firstSegmentTime(bool begins_later) { return begins_later ? 0.4 : 0.25; }

}  // namespace

// Whether the request takes an axis away from a motion that this one makes with it: it then comes
// to rest by its own limits, and not along that motion.
bool Participants::leavesBehind(const Ask& asked, std::size_t axis) {
  bool takes_other = false;
  for (std::size_t other = 0; other < kAxes; ++other) {
    takes_other |= asked.meaning.axes[other] && together_[axis][other];
  }
  return asked.meaning.moves && takes_other && !asked.meaning.axes[axis] &&
         !mayRest(axis, asked.id);
}

void Participants::beginHulls(const Ask& asked) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (leavesBehind(asked, axis)) {
      const double here = placeOnRig(axis);
      hulls_[axis].allow(here - stoppingWay(axis), here + stoppingWay(axis));
    }
    const bool moves = asked.meaning.moves && asked.meaning.axes[axis];
    if (!moves) continue;
    const double backlash = configs_[axis].backlash * configs_[axis].steps_per_unit;
    const auto snapshot = controller_->snapshot();
    const double step = configs_[axis].steps_per_unit / snapshot->axes.at(axis).steps_per_unit;
    const double tolerance = kHullTolerance * step * roundingOf(axis) + backlash;
    if (mayRest(axis, asked.id)) {
      checkHull(axis);
      hulls_[axis].begin(placeOnRig(axis), tolerance);
    } else {
      hulls_[axis].widen(tolerance);
    }
    widenHull(asked, axis);
  }
}

void Participants::widenHull(const Ask& asked, std::size_t axis) {
  Hull& hull = hulls_[axis];
  const double here = placeOnRig(axis);
  const double scale = configs_[axis].steps_per_unit;
  // A motion that takes over may first have to turn.
  if (waits_[axis] || !mayRest(axis, asked.id)) {
    hull.allow(here - stoppingWay(axis), here + stoppingWay(axis));
  }
  const bool is_trajectory = std::holds_alternative<machine::FollowTrajectory>(asked.request);
  if (asked.begins_later || (is_trajectory && !mayRest(axis, asked.id))) {
    // Its first segment begins at whatever speed the axis then has.
    const double swing = firstSegmentTime(asked.begins_later) * configs_[axis].max_speed / 4.0;
    hull.widen(swing * scale + stoppingWay(axis));
  }
  waits_[axis] |= asked.begins_later;
  if (const auto& reach = asked.meaning.reaches[axis]) {
    if (reach->from_path) {
      const auto* begun = std::get_if<machine::FollowTrajectory>(&asked.request);
      if (begun != nullptr) path_begins_[axis].push_back(here);
      for (const double begin : path_begins_[axis]) {
        hull.allow(begin + reach->low * scale, begin + reach->high * scale);
      }
    } else {
      hull.allow(onRig(axis, reach->low), onRig(axis, reach->high));
    }
  }
  if (const auto* setpoints = std::get_if<machine::FollowSetpoints>(&asked.request)) {
    if (setpoints->mode == machine::SetpointMode::kVelocity) return hull.allowAnything();
    for (const machine::Setpoint& setpoint : setpoints->setpoints) {
      if (setpoint.axis != axis) continue;
      const double place = onRig(axis, setpoint.value);
      hull.allow(place - stoppingWay(axis), place + stoppingWay(axis));
    }
  }
  if (std::holds_alternative<machine::Jog>(asked.request) ||
      std::holds_alternative<machine::JogTogether>(asked.request)) {
    hull.allowAnything();
  }
  if (std::holds_alternative<machine::Home>(asked.request)) {
    const config::HomingConfig& homing = *configs_[axis].homing;
    const double way = (homing.max_travel + homing.pull_off) * scale + stoppingWay(axis);
    hull.allow(here - way, here + way);
  }
  if (std::holds_alternative<machine::SetMicrosteps>(asked.request)) {
    const double full_step = configs_[axis].microsteps;
    hull.widen(kHullTolerance * full_step + configs_[axis].backlash * scale);
    hull.allow(here - full_step, here + full_step);
  }
}

void Participants::checkHull(std::size_t axis) {
  if (steps_failed_[axis]) return;
  // Until they are taken back, the steps of other motors that it shares go out.
  const auto& shared = configs_[axis].kinematics;
  for (std::size_t i = 0; port_ && shared && i < shared->axes.size(); ++i) {
    if (steps_failed_[i] || chip_broke_[i]) return;
  }
  const std::string broken = hulls_[axis].broken();
  if (!broken.empty()) oracle_.complain(configs_[axis].name + " " + broken + " microsteps");
}

// Checks the motions that a call has begun against its answer.
void Participants::checkMoves(const Ask& asked, const std::vector<axis::Move>& moves) {
  if (moves.size() != asked.goals.size()) {
    return oracle_.complain(asked.name + " succeeds with " + std::to_string(moves.size()) +
                            " moves");
  }
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const std::size_t axis = asked.goals[i];
    const std::string who = asked.name + ", " + configs_[axis].name;
    const auto& ordered = ordered_[axis];
    const auto begun = static_cast<std::ptrdiff_t>(asked.orders[axis]);
    const std::uint64_t accepted = engine_->channel(static_cast<int>(axis)).accepted;
    if (!asked.begins_later &&
        std::none_of(ordered.begin() + begun, ordered.end(), [&](const Ordered& order) {
          return order.serial <= accepted && order.together == asked.together;
        })) {
      oracle_.complain(who + " succeeds, but the engine has not begun it");
    }
    const double scale = controller_->snapshot()->axes[axis].steps_per_unit;
    const double most = 0.501 * roundingOf(axis) / scale;
    if (asked.meaning.moves && std::abs(moves[i].rest - moves[i].target) > most) {
      oracle_.complain(who + " comes to rest at " + std::to_string(moves[i].rest) +
                       " m, not at the microstep nearest to " + std::to_string(moves[i].target));
    }
    if (!asked.relative && i < asked.ways.size() &&
        std::abs(moves[i].rest - asked.ways[i]) > most) {
      oracle_.complain(who + " comes to rest at " + std::to_string(moves[i].rest) +
                       " m, but was sent to " + std::to_string(asked.ways[i]));
    }
    if (!asked.relative || !asked.targets[i]) continue;
    // A relative goal counts from the target of the last move, which is at most half a step from
    // the actual position.
    const double half_step =
        0.51 * configs_[axis].microsteps * roundingOf(axis) / configs_[axis].steps_per_unit;
    if (std::abs(moves[i].target - *asked.targets[i]) > half_step) {
      oracle_.complain(who + " goes to " + std::to_string(moves[i].target) + " m, not to " +
                       std::to_string(*asked.targets[i]) + " m");
    }
  }
}

// An axis that still moves after a stop has an owner that decelerates it.
void Participants::checkSlowing(const Ask& asked) {
  const auto snapshot = controller_->snapshot();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const std::uint64_t following = engine_->channel(static_cast<int>(axis)).following;
    if (!asked.meaning.axes[axis] || following == 0 || !oracle_.isLatest(asked.id, axis)) continue;
    const auto& motions = snapshot->axes[axis].motions;
    if (std::none_of(motions.begin(), motions.end(), [&](const auto& motion) {
          return motion.serial >= following && motion.slows_down;
        })) {
      oracle_.complain(configs_[axis].name + " doesn't slow down after " + asked.name);
    }
  }
}

// The motor holds the load, and nothing that is known takes its current away.
void Participants::checkEnabled(const Ask& asked) {
  const axis::AxisState state = controller_->snapshot()->axes.at(*asked.enables).state;
  const bool stopped = engine_->emergencyStopped() || close_was_served_;
  const bool braked = state.brake_engaged && !state.asleep;
  if (state.enabled && state.fault.empty() && !stopped && !braked) return;
  oracle_.complain(configs_[*asked.enables].name + " isn't enabled after " + asked.name + ": " +
                   (stopped  ? "it was stopped"
                    : braked ? "its brake is engaged"
                             : "it has no current or a fault " + state.fault));
}

void Participants::postInTurn(int client, std::deque<Turn> turns) {
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.turns = std::move(turns);
  pauseBeforeTurn(who);
}

// A request that was held is answered by the stop that ends the script.
bool Participants::hasTurn(const Client& client) const {
  return script_ && !client.waits() && !client.next && !client.turns.empty();
}

void Participants::pauseBeforeTurn(Client& client) {
  if (hasTurn(client)) client.from = clock_.now() + client.turns.front().after;
}

void Participants::beginTurn(int client) {
  Client& who = clients_[static_cast<std::size_t>(client)];
  const Turn turn = std::move(who.turns.front());
  who.turns.pop_front();
  note("begin " + turn.act.name);
  turn.act.begin(*this, client);
  pauseBeforeTurn(who);
}

void Participants::streamJog(int client, std::size_t axis) {
  const auto snapshot = controller_->snapshot();
  const machine::Jog jog{axis, 0.05, snapshot->axes.at(axis).state.stops};
  postStreamedJog(client, axis, jog, oracle_.moment(), kJogs);
}

void Participants::postStreamedJog(int client, std::size_t axis, const machine::Jog& jog,
                                   std::uint64_t as_of, int left) {
  Meaning meaning;
  meaning.moves = true;
  meaning.axes[axis] = true;
  meaning.as_of = as_of;
  machine::Jog next = jog;
  next.velocity = 0.08 - jog.velocity;
  post(client, "jog stream", jog, meaning);
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.on_answer = [=](const activity::Reply&) {
    if (left == 1) return;
    Client& streams = clients_[static_cast<std::size_t>(client)];
    streams.from = clock_.now() + kJogPeriod;
    streams.next = [=] { postStreamedJog(client, axis, next, as_of, left - 1); };
  };
}

void Participants::streamSetpoints(int client, const std::vector<std::size_t>& axes) {
  const auto snapshot = controller_->snapshot();
  machine::FollowSetpoints setpoints{machine::SetpointMode::kPosition, 0.1, {}};
  for (const std::size_t axis : axes) {
    setpoints.setpoints.push_back({axis, 0.0, snapshot->axes.at(axis).state.stops});
  }
  postStreamedSetpoints(client, setpoints, oracle_.moment(), 0);
}

void Participants::postStreamedSetpoints(int client, const machine::FollowSetpoints& setpoints,
                                         std::uint64_t as_of, int number) {
  Meaning meaning;
  meaning.moves = true;
  meaning.as_of = as_of;
  machine::FollowSetpoints next = setpoints;
  for (machine::Setpoint& setpoint : next.setpoints) {
    meaning.axes[setpoint.axis] = true;
    setpoint.value = 0.0004 * (number < kJogs / 2 ? number + 1 : kJogs - number);
  }
  post(client, "setpoint stream", next, meaning);
  clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply&) {
    if (number + 1 == kJogs) return;
    Client& streams = clients_[static_cast<std::size_t>(client)];
    streams.from = clock_.now() + kJogPeriod;
    streams.next = [=] { postStreamedSetpoints(client, next, as_of, number + 1); };
  };
}

void Participants::postTrajectory(int client, std::vector<std::size_t> axes, double size) {
  wish(client, std::move(axes), size, 0);
}

void Participants::postLaterTrajectory(int client, std::vector<std::size_t> axes, double size) {
  wish(client, std::move(axes), size,
       static_cast<pulse::Nanoseconds>(2 + steps_ % 9 * 25) * 1'000'000);
}

void Participants::wish(int client, std::vector<std::size_t> axes, double size,
                        pulse::Nanoseconds begin_in) {
  const auto snapshot = controller_->snapshot();
  Wish wish{std::move(axes), size, {}, begin_in};
  wish.stops.reserve(wish.axes.size());
  for (const std::size_t axis : wish.axes) {
    wish.stops.push_back(snapshot->axes.at(axis).state.stops);
  }
  clients_[static_cast<std::size_t>(client)].next = [this, client, wish = std::move(wish)] {
    prepareAndPost(client, wish, 0);
  };
}

namespace {

// A stop along a trajectory or a path can't use the acceleration that it has there itself, and
// first one axis may limit it and then the other.
constexpr int kLongerStopOnCurve = 2;

}  // namespace

void Participants::prepareAndPost(int client, const Wish& wish, int tries) {
  const std::vector<std::size_t>& axes = wish.axes;
  const auto snapshot = controller_->snapshot();
  std::vector<motion::PathAxis> facts;
  Meaning meaning;
  meaning.moves = true;
  meaning.longer_stop = kLongerStopOnCurve;
  for (const std::size_t axis : axes) {
    facts.push_back(snapshot->axes.at(axis).path_axis);
    meaning.axes[axis] = true;
    // Its curve swings out by up to half of its size beyond its points.
    const double swing = 0.5 * std::abs(wish.size);
    meaning.reaches[axis] =
        Meaning::Reach{std::min(0.0, wish.size) - swing, std::max(0.0, wish.size) + swing};
  }
  // Forward and a little back; smooth, because an axis without a start speed can't jump.
  static constexpr std::array<double, 3> places = {0.4, 1.0, 0.7};
  static constexpr std::array<double, 3> speeds = {3.0, 0.0, 0.0};
  std::vector<motion::TrajectoryPoint> points(places.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].time = firstSegmentTime(wish.begin_in > 0) * static_cast<double>(i + 1);
    points[i].positions.assign(axes.size(), places.at(i) * wish.size);
    points[i].velocities.assign(axes.size(), speeds.at(i) * wish.size);
    points[i].accelerations.assign(axes.size(), 0.0);
  }
  std::shared_ptr<const motion::PreparedTrajectory> prepared;
  try {
    // All points have velocities, so the states at its begin don't count.
    prepared = std::make_shared<const motion::PreparedTrajectory>(
        facts, points, std::vector<motion::MotionState>(axes.size()));
  } catch (const Refused& refused) {
    note(std::string("the trajectory is refused: ") + refused.what());
    return;
  }
  // Posting the request is a separate step.
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.next = [this, client, wish, tries, prepared, meaning] {
    const pulse::Nanoseconds now = clock_.now() - engine_->state().slipped;
    const std::int64_t begins_ns = wish.begin_in > 0 ? now + wish.begin_in : 0;
    post(client, "follow trajectory",
         machine::FollowTrajectory{wish.axes, prepared, wish.stops, std::nullopt, begins_ns},
         meaning);
    clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply& reply) {
      const bool outdated =
          reply.failure && reply.failure->kind == activity::Failure::Kind::kOutdated;
      if (!outdated || tries >= 8) return;
      clients_[static_cast<std::size_t>(client)].next = [=] {
        prepareAndPost(client, wish, tries + 1);
      };
    };
  };
}

namespace {

motion::PathSegment lineTo(std::vector<double> end) {
  motion::PathSegment segment;
  segment.end = std::move(end);
  return segment;
}

// The tolerance of any path that is posted here.
constexpr double kPathTolerance = 0.0012;  // m

Meaning::Reach reachOfPath(double size, double tolerance) {
  return {std::min(0.0, size) - tolerance, std::max(0.0, size) + tolerance, true};
}

}  // namespace

void Participants::postPath(int client, const std::vector<std::size_t>& axes, double size) {
  const motion::PathRequest request{
      {}, {lineTo({size, 0.0}), lineTo({size, size})}, true, 0.0, size / 10.0, true};
  followPath(client, axes, size, request);
}

void Participants::postMarkedPath(int client, const std::vector<std::size_t>& axes, double size) {
  motion::PathRequest request{
      {}, {lineTo({size, 0.0}), lineTo({size, size}), lineTo({0.0, size})}, true, 0.0, size / 10.0};
  request.segments[1].outputs = {{kTool, true}};
  request.segments[2].outputs = {{kTool, false, 1.0, 0.5 * size}};
  followPath(client, axes, size, request);
}

void Participants::postSlowPath(int client, const std::vector<std::size_t>& axes, double first,
                                double second) {
  // [s] Each of the lines: both end before kLongestCall with an override of 0.4 too.
  constexpr double kLongest = 15.0;
  constexpr double kMostSize = 0.0005;  // m
  const double begin = std::min(kMostSize, kLongest * first);
  const double end = begin + std::min(kMostSize, kLongest * second);
  motion::PathRequest request{{}, {lineTo({begin, 0.0}), lineTo({end, 0.0})}, true};
  request.segments[0].velocity = first;
  request.segments[1].velocity = second;
  followPath(client, axes, end, request);
}

void Participants::followPath(int client, const std::vector<std::size_t>& axes, double size,
                              motion::PathRequest request) {
  const auto snapshot = controller_->snapshot();
  machine::FollowTrajectory wanted{axes, nullptr, {}, machine::FollowTrajectory::Path{}};
  std::vector<motion::PathAxis> facts;
  std::vector<motion::PathOrigin> origins;
  std::vector<motion::MotionState> expected;
  Meaning meaning;
  meaning.moves = true;
  meaning.longer_stop = kLongerStopOnCurve;
  for (const std::size_t axis : axes) {
    const machine::AxisSnapshot& now = snapshot->axes.at(axis);
    request.names.push_back(configs_[axis].name);
    facts.push_back(now.path_axis);
    origins.push_back({now.rest, now.commanded});
    expected.push_back({motion::DoubleDouble(now.rest), 0.0, 0.0});
    wanted.stops.push_back(now.state.stops);
    wanted.path->from.push_back(now.rest);
    meaning.axes[axis] = true;
    meaning.reaches[axis] = reachOfPath(size, request.tolerance);
  }
  try {
    motion::PathPlan plan =
        motion::planPath(request, facts, origins, optionsOf(schedule_.variant).outputs);
    wanted.path->targets = plan.targets;
    wanted.path->window = plan.window;
    wanted.prepared = std::make_shared<const motion::PreparedTrajectory>(
        facts, plan.points, expected, false, std::move(plan.marks));
  } catch (const Refused& refused) {
    return note(std::string("the path is refused: ") + refused.what());
  }
  // Posting the request is a separate step.
  Client& who = clients_[static_cast<std::size_t>(client)];
  std::size_t marks = 0;
  for (const motion::PathSegment& segment : request.segments) marks += segment.outputs.size();
  who.next = [=, more_follows = request.more_follows] {
    post(client, "follow path", wanted, meaning);
    clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply& reply) {
      if (reply.failure) return;
      for (const std::size_t axis : axes) path_axes_[axis] = axes;
      const auto& moves = std::get<std::vector<axis::Move>>(reply.value);
      if (marks > 0) marked_.emplace_back(moves.front().outcome, marks);
      if (!more_follows) return;
      for (const axis::Move& move : moves) open_paths_.insert(move.id);
    };
  };
}

void Participants::appendToPath(int client, std::size_t axis, double size, bool is_last) {
  const auto snapshot = controller_->snapshot();
  const auto& path = snapshot->axes.at(axis).path;
  const auto queued = path ? std::dynamic_pointer_cast<const motion::QueuedPath>(path->shared)
                           : std::shared_ptr<const motion::QueuedPath>();
  if (!queued) return note("there is no path to append to");
  const pulse::Nanoseconds now = clock_.now() - engine_->state().slipped;
  const pulse::Nanoseconds append_lead = engine_->horizon() + 20 * kMillisecond;
  const double passed = path->along->stateAt(now).position.value();
  const double changeable = path->slows_down
                                ? path->along->endPosition().value()
                                : path->along->stateAt(now + append_lead).position.value();
  machine::ExtendPath wanted{axis, path->move, {queued, nullptr, passed, passed, true, {}}};
  try {
    std::vector<motion::PathSegment> segments;
    if (size != 0.0) segments.push_back(lineTo({size, size / 2.0}));
    wanted.extension.moves_on = !segments.empty();
    const motion::QueuedPath::Longer longer =
        queued->extended(segments, !is_last, passed, changeable);
    wanted.extension.path = longer.path;
    wanted.extension.same_from = longer.same_from;
    wanted.extension.same_until = longer.same_until;
    wanted.extension.targets = longer.path->targets();
  } catch (const Refused& refused) {
    return note(std::string("the append is refused: ") + refused.what());
  }
  // It continues a motion, but begins none if that was stopped.
  Meaning meaning;
  meaning.moves = true;
  meaning.longer_stop = kLongerStopOnCurve;
  for (const std::size_t own : path_axes_[axis]) {
    meaning.axes[own] = true;
    meaning.reaches[own] = reachOfPath(size, kPathTolerance);
  }
  meaning.as_of = oracle_.moment();
  clients_[static_cast<std::size_t>(client)].next = [=] {
    post(client, "append to the path", wanted, meaning);
    clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply& reply) {
      if (reply.failure) return;
      moveEnds(*snapshot, path_axes_[axis], wanted.extension.targets);
      for (const std::size_t own : path_axes_[axis]) {
        if (is_last) open_paths_.erase(snapshot->axes.at(own).path->move);
      }
    };
  };
}

// The path leads somewhere else now.
void Participants::moveEnds(const machine::MachineSnapshot& before,
                            const std::vector<std::size_t>& axes,
                            const std::vector<double>& targets) {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const machine::AxisSnapshot& own = before.axes.at(axes.at(i));
    for (auto& [name, move] : moves_) {
      if (!own.path || move.id != own.path->move) continue;
      move.rest = own.path_axis.positionOf(own.path_axis.restAt(targets[i]));
    }
  }
}

void Participants::switchTool(int client, bool on) {
  post(client, on ? "switch the tool on" : "switch the tool off", machine::SetOutput{kTool, on},
       {});
}

machine::BeginLatch Participants::latchOf(const std::vector<std::size_t>& axes,
                                          machine::LatchEdge edge) {
  machine::BeginLatch latch;
  latch.id = ++calls_;
  latch.wanted.input = kProbeInput;
  latch.wanted.edge = edge;
  latch.axes = axes;
  latch.record = std::make_shared<machine::LatchRecord>();
  latches_.emplace_back(latch.id, latch.record);
  return latch;
}

// One that was refused has no result.
void Participants::forgetLatch(std::uint64_t id) {
  latches_.erase(std::find_if(latches_.begin(), latches_.end(),
                              [id](const auto& latch) { return latch.first == id; }));
}

void Participants::postProbing(int client, const std::vector<std::size_t>& axes,
                               const std::vector<double>& ways, bool away) {
  const auto snapshot = controller_->snapshot();
  ProbingUnderWay probing;
  probing.stroke.line.axes = axes;
  probing.stroke.line.positions = ways;
  probing.stroke.line.relative = true;
  probing.meaning.moves = true;
  // A stop ends all of its strokes.
  probing.meaning.as_of = oracle_.moment();
  for (const std::size_t axis : axes) {
    probing.stroke.stops.push_back(snapshot->axes.at(axis).stopsOtherThanHolds());
    probing.meaning.axes[axis] = true;
  }
  probing.edge = away ? machine::LatchEdge::kInactive : machine::LatchEdge::kActive;
  postStroke(client, std::move(probing));
}

void Participants::postStroke(int client, ProbingUnderWay probing) {
  machine::ProbeStroke& stroke = probing.stroke;
  stroke.is_first = probing.strokes == 0;
  stroke.line.velocity = probing.strokes == 0 ? kFirstTouch : 0.0;
  if (probing.strokes == 2) stroke.line.velocity = kSecondTouch;
  stroke.latch.reset();
  if (probing.strokes != 1) stroke.latch = latchOf(stroke.line.axes, probing.edge);
  const machine::ProbeStroke posted = stroke;
  post(client, "stroke of a probing", posted, probing.meaning);
  clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply& reply) {
    if (reply.failure) {
      if (posted.latch) forgetLatch(posted.latch->id);
      return;
    }
    ProbingUnderWay begun = probing;
    const auto& moves = std::get<std::vector<axis::Move>>(reply.value);
    begun.outcome = moves.front().outcome;
    if (probing.strokes == 0) {
      const auto snapshot = controller_->snapshot();
      for (std::size_t i = 0; i < moves.size(); ++i) {
        begun.targets.push_back(moves[i].target);
        begun.begin.push_back(snapshot->axes.at(posted.line.axes[i]).memory.position);
      }
    }
    awaitStroke(client, begun);
  };
}

void Participants::awaitStroke(int client, const ProbingUnderWay& probing) {
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.from = clock_.now() + kProbeLook;
  who.next = [=] {
    const auto ended = probing.outcome->get();
    const bool touches = probing.strokes != 1;
    const auto latched = touches ? probing.stroke.latch->record->result() : std::nullopt;
    const bool is_held = controller_->snapshot()->axes.front().state.held;
    if (!ended || (touches && !latched) || is_held) return awaitStroke(client, probing);
    strokeEnded(client, probing, *ended);
  };
}

void Participants::strokeEnded(int client, ProbingUnderWay probing, const axis::MoveResult& ended) {
  if (probing.strokes == 1) {
    if (ended.end != axis::MoveEnd::kReached) return;
    probing.strokes = 2;
    probing.stroke.line.continueTo(probing.targets);
    return postStroke(client, std::move(probing));
  }
  const machine::LatchResult latched = *probing.stroke.latch->record->result();
  if (!latched.latched) {
    if (ended.message.find("contact") != std::string::npos) {
      oracle_.complain("a probing has no contact, but ends: " + ended.message);
    }
    return;
  }
  checkEdge(*latched.edge);
  if (probing.strokes == 2 || ended.end != axis::MoveEnd::kStopped) return;
  // Half of the way back.
  std::vector<double> back;
  for (std::size_t i = 0; i < probing.begin.size(); ++i) {
    probing.contact.push_back(latched.edge->axes.at(i).position);
    back.push_back(0.5 * (probing.contact[i] + probing.begin[i]));
  }
  probing.strokes = 1;
  probing.stroke.line.continueTo(back);
  postStroke(client, std::move(probing));
}

void Participants::beginLatch(int client) {
  machine::BeginLatch latch = latchOf({0, 1, 2}, machine::LatchEdge::kEither);
  latch.wanted.every = true;
  post(client, "latch", latch, {});
  clients_[static_cast<std::size_t>(client)].on_answer = [=](const activity::Reply& reply) {
    if (reply.failure) forgetLatch(latch.id);
  };
}

void Participants::endLatches(int client) {
  for (const auto& [id, record] : latches_) {
    if (record->result()) continue;
    return post(client, "end a latch", machine::EndLatch{id}, {});
  }
}

// The probe is pressed by the step of x that reaches it, and the position is half a step before
// that. Where the time at which a step is made isn't the planned one, nor is the place.
void Participants::checkEdge(const machine::LatchedEdge& edge) {
  const machine::LatchedAxis& x = edge.axes.front();
  if (x.name != configs_[0].name || !x.position_valid || position_changed_) return;
  if (!schedule_.deviations.empty() || schedule_.ahead) return;
  if (steps_failed_[0] || chip_broke_[0] || power_was_lost_ || had_trouble_) return;
  const auto snapshot = controller_->snapshot();
  const double step = 1e3 * roundingOf(0) / snapshot->axes[0].steps_per_unit;  // [mm]
  const double place = 1e3 * x.position;
  const double beside = std::min(std::abs(place - kPressedFrom), std::abs(place - kPressedTo));
  if (beside <= kHullTolerance * step) return;
  oracle_.complain(fmt::format("the probe has changed at {} mm, but is pressed from {} to {} mm",
                               place, kPressedFrom, kPressedTo));
}

// Nobody waits for a latch in vain.
void Participants::checkLatches() {
  const auto latches = latches_;  // clients play on meanwhile
  for (const auto& [id, record] : latches) {
    std::uint64_t number = 0;
    for (const machine::LatchedEdge& edge : record->take()) {
      if (edge.number != ++number) {
        oracle_.complain(fmt::format("edge {} of a latch is its number {}", number, edge.number));
      }
      checkEdge(edge);
    }
    if (!closed_) ask("end a latch", machine::EndLatch{id}, {});
    const auto result = record->result();
    if (!result) {
      oracle_.complain("a latch has no result in the end");
    } else if (givesNoReason(result->message) || result->edges != number) {
      oracle_.complain(fmt::format("a latch has {} edges, but ends: {}", number, result->message));
    }
  }
}

void Participants::compareTool(int client) {
  config::PositionCompare compare;
  compare.axis = configs_[kCompared].name;
  const bool pulses = client == 1;
  if (pulses) {
    compare.every = config::PositionCompare::Every{kPulseEvery, -8 * kPulseEvery, 8 * kPulseEvery};
    compare.pulse_ns = kPulse;
  } else {
    compare.cams = {kToolCam};
  }
  post(client, pulses ? kComparesPulses : kComparesCam,
       machine::SetPositionCompare{kTool, std::move(compare)}, {});
}

void Participants::emergencyStop(int client) {
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.waits_for_stops = engine_->emergencyStop();
  oracle_.emergencyStopped(clock_.now(), rampBegins());
}

// A controller that is late decelerates late.
std::optional<pulse::Nanoseconds> Participants::rampBegins() const {
  if (!ramps()) return std::nullopt;
  return schedule_.deviations.empty() ? 0 : pulse::EmergencyStops::kRampBegins;
}

bool Participants::ramps() const {
  return emergencyDisableOf(schedule_.variant) == machine::EmergencyDisable::kRamp;
}

void Participants::shutDown(int client) {
  closed_ = true;
  Meaning all;
  all.axes.fill(true);
  all.quiet = Meaning::Quiet::kSlowsDown;
  all.ends_hold = true;
  post(client, "close", machine::Close{"the machine was shut down"}, all);
  Client& who = clients_[static_cast<std::size_t>(client)];
  who.on_answer = [this, client, all](const activity::Reply&) {
    Meaning rest = all;
    rest.quiet = Meaning::Quiet::kAtRest;
    post(client, "await rest", machine::AwaitRest{}, rest);
    clients_[static_cast<std::size_t>(client)].on_answer = [this, client,
                                                            rest](const activity::Reply&) {
      post(client, "power down", machine::PowerDown{}, rest);
    };
  };
}

void Participants::stopLastMove(int client, std::size_t axis) {
  post(client, "stop the last move", machine::StopMove{axis, last_move_[axis]}, {});
}

void Participants::cancelHomings(int client) {
  machine::CancelHoming cancel;
  for (const activity::AcceptedHoming& homing : homings_) {
    cancel.ids.insert(cancel.ids.end(), homing.ids.begin(), homing.ids.end());
  }
  post(client, "cancel homing", cancel, {});
}

void Participants::pressSwitch(std::size_t axis, bool pressed) {
  sim::RigFaults faults;
  if (pressed) faults.max_stuck = true;
  rig_.setFaults(configs_[axis].name, faults);
}

void Participants::breakChip(std::size_t axis) {
  sim::RigFaults faults;
  chip_broke_[axis] = true;
  faults.chip_fault_after = 5;
  rig_.setFaults(configs_[axis].name, faults);
}

void Participants::resetChip() {
  if (!hasRegisters(configs_)) return;
  rig_.brownOut(configs_[0].name);
  trouble_since_ = clock_.now();
  had_trouble_ = true;
}

void Participants::silenceChip() {
  if (!hasRegisters(configs_)) return;
  rig_.powerChip(configs_[0].name, false);
  is_silent_ = true;
  trouble_since_ = clock_.now();
  had_trouble_ = true;
}

void Participants::heatChip() {
  if (!hasRegisters(configs_)) return;
  sim::TmcTrouble trouble;
  trouble.over_temperature = true;
  rig_.setTrouble(configs_[0].name, trouble);
  trouble_since_ = clock_.now();
  had_trouble_ = true;
}

// No fault is said to be one of the registers without a cause there.
void Participants::noteTrouble() {
  const axis::AxisState x = controller_->snapshot()->axes[0].state;
  if (x.fault.empty()) return;
  trouble_since_.reset();
  const bool has_cause = had_trouble_ || chip_broke_[0] || steps_failed_[0];
  if (!has_cause && x.fault.find("TMC") != std::string::npos) {
    oracle_.complain(configs_[0].name + " is at fault, though nothing is wrong: " + x.fault);
  }
}

// Each is known in time, except to a machine that was shut down.
void Participants::checkTroubles() {
  if (!had_trouble_) return;
  const pulse::Nanoseconds known = clock_.now() + kTroubleIsKnown;
  playUntil([&] { return clock_.now() >= known; }, kLongestCall);
  const axis::AxisState x = controller_->snapshot()->axes[0].state;
  if (closed_ || !trouble_since_ || !x.fault.empty() || !x.drivers->front().is_set_up) return;
  oracle_.complain(fmt::format("the trouble of {}'s chip at {} ns isn't known at {} ns",
                               configs_[0].name, *trouble_since_, clock_.now()));
}

// At rest they are what the axis says of its driver.
void Participants::checkRegisters() {
  if (had_trouble_ && closed_) return;  // a machine that was shut down asks no chip
  namespace tmc = driver::tmc;
  if (!hasRegisters(configs_)) return;
  if (!playUntil([this] { return accesses_.empty() && accesses_done_.empty(); }, kLongestCall)) {
    return oracle_.complain("the jobs on registers don't end");
  }
  const axis::AxisState x = controller_->snapshot()->axes[0].state;
  const driver::DriverState& told = x.drivers->front();
  if (!told.is_set_up || !x.fault.empty()) return;
  const auto expect = [this](const char* what, double is, double should) {
    if (std::abs(is - should) <= 1e-9) return;
    oracle_.complain(fmt::format("{} of x's chip is {}, but the axis says {}", what, is, should));
  };
  const auto written = [this](int number) { return rig_.registerOf(configs_[0].name, number); };
  const std::uint32_t chopconf = written(tmc::kChopconf);
  expect("the microsteps", microstepsOf(chopconf), x.microsteps);
  expect("TOFF", chopconf & tmc::kToff, 3);
  const tmc::Board board{tmc::Model::kTmc2209, configs_[0].tmc->sense_resistor};
  const tmc::CurrentRange range{(chopconf & tmc::kVsense) != 0, 256};
  const std::uint32_t currents = written(tmc::kIholdIrun);
  const auto current = [&](unsigned shift) {
    return tmc::currentOf(static_cast<int>(currents >> shift & 0x1FU), range, board);
  };
  expect("the run current", current(8), told.run_current);
  expect("the hold current", current(0), told.hold_current);
  for (const int of_stall : {tmc::kTcoolthrs, tmc::kSgthrs}) {
    expect("a register of stalls", written(of_stall), 0);
  }
}

// Participants that wait for their turn may see the loss much later.
void Participants::checkPowered(std::size_t axis, pulse::Nanoseconds now) {
  if (!power_lost_since_) return;
  if (now <= *power_lost_since_ + kLossIsSeen + takingBack(schedule_)) return;
  if (!schedule_.deviations.empty()) return;
  oracle_.complain(configs_[axis].name + " steps long after the motor power was lost");
}

void Participants::neverInPosition() {
  sim::RigFaults faults;
  faults.never_in_position = true;
  rig_.setFaults(configs_[2].name, faults);
  if (!never_in_position_) never_in_position_ = moves_.size();
}

void Participants::pressEmergencyStop(bool pressed) {
  rig_.setInput(kEmergencyStop, pressed, clock_.now());
}

void Participants::failSteps(std::size_t axis) {
  steps_failed_[axis] = true;
  rig_.failWrites(configs_[axis].pins.step.line, 30, EIO);
}

void Participants::failTurns(std::size_t axis) {
  const config::Pins& pins = configs_[axis].pins;
  // The coils of a motor are its steps and its current too.
  steps_failed_[axis] = steps_failed_[axis] || hasPhases(configs_[axis]);
  pins_failed_ = pins_failed_ || hasPhases(configs_[axis]);
  rig_.failWrites(hasPhases(configs_[axis]) ? pins.in2.line : pins.dir.line, 0, EIO);
}

void Participants::failSwitch(std::size_t axis) {
  lines_->fail(wiring_.channels[axis].endstop_max->line, EIO);
}

void Participants::failEmergencyStop() { lines_->fail(wiring_.emergency_stop->line, EIO); }

void Participants::loseMotorPower() {
  if (!wiring_.motor_power) return;
  rig_.stickMotorPower(false, clock_.now());
  if (!power_lost_since_) power_lost_since_ = clock_.now();
  power_was_lost_ = true;
}

void Participants::mendLines() {
  if (power_lost_since_) {
    rig_.stickMotorPower({}, clock_.now());
    power_lost_since_.reset();
    // It may be back before anything has noticed.
    position_changed_ = true;
  }
  lines_->fail(-1, 0);
  if (had_trouble_) rig_.setTrouble(configs_[0].name, {});
  if (std::exchange(is_silent_, false)) rig_.powerChip(configs_[0].name, true);
  for (const config::AxisConfig& config : configs_) {
    if (hasPhases(config)) {
      rig_.clearWriteFault(config.pins.in2.line);
    } else {
      rig_.clearWriteFault(config.pins.step.line);
      rig_.clearWriteFault(config.pins.dir.line);
    }
  }
}

// ---- all participants together ----

bool Participants::playUntil(const std::function<bool()>& ready, pulse::Nanoseconds longest) {
  const std::size_t began = steps_;
  const pulse::Nanoseconds end = clock_.now() + longest;
  while (!ready()) {
    if (steps_ - began > kMostSteps || clock_.now() > end || !step()) return ready();
    if (!oracle_.complaints.empty()) return true;
  }
  return true;
}

activity::Reply Participants::ask(const std::string& name, machine::Request request,
                                  const Meaning& meaning) {
  activity::Reply got;
  bool answered = false;
  post(kProbe, name, std::move(request), meaning);
  clients_[kProbe].on_answer = [&](const activity::Reply& reply) {
    got = reply;
    answered = true;
  };
  if (!playUntil([&] { return answered; }, kLongestCall)) {
    oracle_.complain(name + " isn't answered");
    clients_[kProbe].on_answer = nullptr;
  }
  return got;
}

bool Participants::atRest() {
  if (!open_.empty() || !requests_.empty() || !jobs_.empty() || !pins_done_.empty()) return false;
  if (core_->hasNews() || clock_.woken || core_->isHeldUp()) return false;
  if (port_ && port_->playDue() != pulse::kNever) return false;
  for (std::size_t i = 0; i < kAxes; ++i) {
    if (engine_->channel(static_cast<int>(i)).following != 0) return false;
  }
  const auto snapshot = controller_->snapshot();
  if (std::any_of(snapshot->axes.begin(), snapshot->axes.end(), [](const auto& axis) {
        return axis.state.moving || axis.state.homing != axis::HomingPhase::kNone;
      })) {
    return false;
  }
  return std::all_of(moves_.begin(), moves_.end(),
                     [](const auto& move) { return move.second.outcome->get().has_value(); });
}

// In motion too: the counts are those of the edges that have gone out, and the plan is at the same
// place.
void Participants::checkLive() {
  for (std::size_t axis = 0; axis < kAxes && oracle_.complaints.empty(); ++axis) {
    if (!steps_failed_[axis] && configs_[axis].kinematics == nullptr) checkLive(axis);
  }
}

void Participants::checkLive(std::size_t axis) {
  const config::AxisConfig& config = configs_[axis];
  const pulse::ChannelState live = engine_->channel(static_cast<int>(axis));
  const sim::RigAxisReport report = rig_.report(config.name);
  const std::int64_t seen = report.pulses_forward - report.pulses_backward;
  const std::int64_t told = seen - (port_ ? port_->untold(axis) : 0);
  if (live.epoch == 0 && live.count + live.lags[0] != told) {
    oracle_.complain(fmt::format("{} moves: the engine stands at {}, the rig has told {}",
                                 config.name, live.count + live.lags[0], told));
  }
  const auto snapshot = controller_->snapshot();
  const machine::AxisSnapshot& now = snapshot->axes.at(axis);
  const pulse::Nanoseconds time = clock_.now() - engine_->state().slipped;
  const axis::AxisState state = machine::stateOf(now, live, time, time);
  // The engine and the board may be late, and a step is at the middle between two counts. An engine
  // that is late again has not yet caught up with what it was late before.
  const auto late = static_cast<double>(takingBack(schedule_) + kLatestPass + kMillisecond) * 1e-9;
  const double behind = isEngineLate(schedule_) ? lateStepsOf(config) / config.steps_per_unit : 0.0;
  const double most = 2.0 / now.steps_per_unit + behind + config.max_speed * late;
  if (std::abs(state.planned - state.position) > most) {
    oracle_.complain(fmt::format("{} stands at {} m, but is planned to be at {} m", config.name,
                                 state.position, state.planned));
  }
}

void Participants::checkCounts(const std::string& when) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) checkCount(axis, when);
}

// Until the loss of the power is known, axes may step without it.
sim::RigAxisReport Participants::reportOf(const std::string& rig_axis) const {
  sim::RigAxisReport report = rig_.report(rig_axis);
  if (power_was_lost_) report.violations.erase(sim::Violation::kStepWithoutPower);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (rig_axis != configs_[axis].name || !hasPhases(configs_[axis]) || !steps_failed_[axis]) {
      continue;
    }
    // See trace_->rose.
    for (const sim::Violation known :
         {sim::Violation::kStepAfterEnable, sim::Violation::kPatternJump,
          sim::Violation::kShortStepHigh, sim::Violation::kAboveTopRate,
          sim::Violation::kAboveAcceleration}) {
      report.violations.erase(known);
    }
    report.beyond_limits.clear();
  }
  if (had_trouble_ && rig_axis == configs_[0].name) {
    // Without its registers, a chip makes other steps, or none, from any moment on.
    for (const sim::Violation known :
         {sim::Violation::kStepWhileDisabled, sim::Violation::kStepAfterEnable,
          sim::Violation::kModeHold, sim::Violation::kAboveTopRate,
          sim::Violation::kAboveAcceleration}) {
      report.violations.erase(known);
    }
    report.beyond_limits.clear();
  }
  return report;
}

void Participants::checkCount(std::size_t axis, const std::string& when) {
  const std::string who = configs_[axis].name + " " + when;
  const pulse::ChannelState state = engine_->channel(static_cast<int>(axis));
  const sim::RigAxisReport report = reportOf(configs_[axis].name);
  const std::int64_t pulses = report.pulses_forward + report.pulses_backward;
  // If a falling edge could not be written, the next rising edge is left out.
  // A motor that has reached its switch before the others leaves some out.
  const bool all = state.lags[0] == 0;
  if (!steps_failed_[axis] && all && static_cast<std::int64_t>(state.pulses) != pulses) {
    oracle_.complain(who + ": the engine counts " + std::to_string(state.pulses) +
                     " pulses, the rig " + std::to_string(pulses));
  }
  const std::int64_t count = report.pulses_forward - report.pulses_backward;
  const bool shares = configs_[axis].kinematics != nullptr;
  const std::int64_t counted = shares ? state.own : state.count + state.lags[0];
  if (!steps_failed_[axis] && state.epoch == 0 && counted != count) {
    oracle_.complain(who + ": the engine stands at " + std::to_string(counted) + ", the rig at " +
                     std::to_string(count));
  }
  const std::string violations = test::violationsOf(report);
  if (!violations.empty()) oracle_.complain(who + ": " + violations);
  for (std::size_t motor = 1; motor < configs_[axis].motors(); ++motor) {
    const sim::RigAxisReport twin = reportOf(configs_[axis].traceName(motor));
    const std::int64_t expected = state.count + state.lags.at(motor);
    const std::int64_t seen = twin.pulses_forward - twin.pulses_backward;
    if (!steps_failed_[axis] && seen != expected) {
      oracle_.complain(who + ": motor " + std::to_string(motor) + " stands at " +
                       std::to_string(seen) + ", not at " + std::to_string(expected));
    }
    const std::string of_twin = test::violationsOf(twin);
    if (!of_twin.empty()) oracle_.complain(who + ", another motor: " + of_twin);
  }
  // Nothing holds the load while the brake takes hold after a fault of the chip or of the power;
  // and an emergency stop takes the motor power also if the brake's line could not be written.
  const bool brake_failed = pins_failed_ && wiring_.motor_power;
  if (report.fell > 0.0 && !chip_broke_[axis] && !brake_failed && !power_was_lost_) {
    oracle_.complain(who + ": the load has fallen by " + std::to_string(report.fell) + " mm");
  }
}

// If a position is said to be valid, the carriage is there.
void Participants::checkRest() {
  if (position_changed_) return;
  const auto snapshot = controller_->snapshot();
  for (std::size_t i = 0; i < kAxes; ++i) {
    const machine::AxisSnapshot& axis = snapshot->axes[i];
    // A machine that was shut down asks no chip.
    const bool is_unasked = i == 0 && had_trouble_ && closed_;
    if (!axis.state.position_valid || is_unasked) continue;
    const pulse::ChannelState live = engine_->channel(static_cast<int>(i));
    const axis::AxisState state = machine::stateOf(axis, live, clock_.now(), clock_.now());
    const double carriage = rig_.report(configs_[i].name).carriage / 1000.0;
    const double reached = (static_cast<double>(axis.backlash) + 1.01) / axis.steps_per_unit;
    if (std::abs(state.position - carriage) > reached) {
      oracle_.complain(configs_[i].name + " says that it is at " + std::to_string(state.position) +
                       " m, but its carriage is at " + std::to_string(carriage) + " m");
    }
    for (std::size_t motor = 1; state.homed && motor < configs_[i].motors(); ++motor) {
      const double twin = rig_.report(configs_[i].traceName(motor)).carriage / 1000.0;
      if (std::abs(twin - carriage) <= 1.01 / axis.steps_per_unit) continue;
      oracle_.complain(configs_[i].name + " is homed, but its motors are " +
                       std::to_string(twin - carriage) + " m apart");
    }
  }
}

// A pulse begins in the pass that makes the step to its place.
void Participants::checkPulse() {
  if (!compares_pulses_) return;
  const bool is_on = rig_.outputLevel(kTool) == tool_level_;
  if (std::exchange(tool_was_on_, is_on) == is_on || !is_on) return;
  const pulse::OutputLineState tool = engine_->output(0);
  if (tool.compare == 0 || tool.muted) return;
  // Late steps follow the plan, and steps that are put ahead are counted when they are played.
  if (isEngineLate(schedule_) || schedule_.ahead) return;
  const pulse::ChannelState y = engine_->channel(static_cast<int>(kCompared));
  const auto snapshot = controller_->snapshot();
  const machine::AxisSnapshot& now = snapshot->axes[kCompared];
  const double place =
      now.origin + (static_cast<double>(y.count - y.slack) + y.between) / now.steps_per_unit;
  const double away = std::remainder(place, kPulseEvery) * now.steps_per_unit;
  // Motors that axes share step one after the other.
  if (std::abs(away) <= (schedule_.variant == kSharing ? 2.0 : 1.01)) return;
  oracle_.complain(fmt::format("a pulse begins {:.2f} steps away from its place", away));
}

// At rest in its cam an output is on, and out of it off, however the axis got there.
void Participants::checkCompared() {
  const pulse::OutputLineState tool = engine_->output(0);
  const pulse::ChannelState y = engine_->channel(static_cast<int>(kCompared));
  if (tool.compare == 0 || tool.muted || tool.too_long || y.following != 0 || pins_failed_) return;
  const config::OutputConfig config = optionsOf(schedule_.variant).outputs[0];
  if (clock_.now() < tool.written.switched + std::max(config.min_on_ns, kPulse)) return;
  if (compares_pulses_) {
    if (rig_.outputLevel(kTool) == config.level(true)) oracle_.complain("a pulse doesn't end");
    return;
  }
  const auto snapshot = controller_->snapshot();
  const machine::AxisSnapshot& now = snapshot->axes[kCompared];
  const double place = static_cast<double>(y.count - y.slack) + y.between;
  const auto count_of = [&now](double at) { return (at - now.origin) * now.steps_per_unit; };
  const double to_edge = std::min(place - count_of(kToolCam.from), count_of(kToolCam.to) - place);
  // Motors that axes share stand up to a microstep beside where their motion led.
  if (std::abs(to_edge) < 2.0) return;
  if (rig_.outputLevel(kTool) == config.level(to_edge > 0.0)) return;
  oracle_.complain("y stands at " + std::to_string(now.origin + place / now.steps_per_unit) +
                   " m, but the tool is " + (to_edge > 0.0 ? "off" : "on"));
}

// An emergency stop that nothing has ended leaves no motor with current, if it is configured so.
void Participants::checkPower() {
  const bool off = emergencyDisableOf(schedule_.variant) != machine::EmergencyDisable::kHold;
  if (!off || !engine_->emergencyStopped()) return;
  const auto has_current = [this](const config::AxisConfig& config) {
    return rig_.report(config.name).energized;
  };
  const auto all_are_off = [&] {
    return std::none_of(configs_.begin(), configs_.end(), has_current);
  };
  if (playUntil(all_are_off, kLongestCall) || pins_failed_) return;
  oracle_.complain("a motor has current long after an emergency stop");
}

// What was accepted and leads to a place ends by itself, unless it is held.
void Participants::checkEnds() {
  const auto is_over = [this](const auto& named) {
    const auto& [name, move] = named;
    return name.rfind("jog", 0) == 0 || open_paths_.count(move.id) != 0 ||
           move.outcome->get().has_value();
  };
  const auto is_homed = [](const activity::AcceptedHoming& homing) {
    return std::all_of(homing.outcomes.begin(), homing.outcomes.end(),
                       [](const auto& outcome) { return outcome->get().has_value(); });
  };
  const auto all_are_over = [&] {
    return controller_->snapshot()->axes.front().state.held ||
           (std::all_of(moves_.begin(), moves_.end(), is_over) &&
            std::all_of(homings_.begin(), homings_.end(), is_homed));
  };
  if (playUntil(all_are_over, kLongestCall)) return;
  const auto never = std::find_if_not(moves_.begin(), moves_.end(), is_over);
  oracle_.complain((never != moves_.end() ? never->first : "a homing") + " never ends");
}

void Participants::checkOutcomes() {
  // Another axis may have made only one of the two steps that together leave this one in place, and
  // may come to rest elsewhere than it was to when this one was promised its place.
  const bool shares = schedule_.variant == kSharing;
  double reached = 1e-9;
  for (std::size_t axis = 0; shares && axis < kAxes; ++axis) {
    reached = std::max(reached, 0.51 * roundingOf(axis) / configs_[axis].steps_per_unit);
  }
  const auto misses = [&](const axis::Move& move, double position) {
    const bool near_target = shares && std::abs(position - move.target) <= reached;
    return std::abs(position - move.rest) > reached && !near_target;
  };
  for (const auto& [name, move] : moves_) {
    const auto result = move.outcome->get();
    if (!result) {
      oracle_.complain("the outcome of " + name + " is not set");
    } else if (givesNoReason(result->message)) {
      oracle_.complain(name + " ends without a reason: " + result->message);
    } else if (result->end == axis::MoveEnd::kReached && name.rfind("jog", 0) != 0 &&
               misses(move, result->position)) {
      oracle_.complain(name + " has reached " + std::to_string(result->position) +
                       " m, but was to come to rest at " + std::to_string(move.rest) +
                       " m: " + result->message);
    }
  }
  for (const activity::AcceptedHoming& homing : homings_) {
    for (const auto& outcome : homing.outcomes) {
      const auto result = outcome->get();
      if (!result) {
        oracle_.complain("the outcome of a homing is not set");
      } else if (givesNoReason(result->message)) {
        oracle_.complain("a homing ends without a reason: " + result->message);
      }
    }
  }
}

// Each place of a path is switched once, or counted as one that was not. A fault of any axis takes
// the outputs to their safe states.
void Participants::checkMarks() {
  for (const auto& [outcome, marks] : marked_) {
    const auto result = outcome->get();
    if (!result) continue;  // checkOutcomes() says so
    const bool is_whole = result->end == axis::MoveEnd::kReached && !pins_failed_;
    const bool all_made = !is_whole || result->marks_not_made == 0;
    if (result->marks_made + result->marks_not_made == marks && all_made) continue;
    oracle_.complain(fmt::format("a path has made {} of its {} switches and not made {}: {}",
                                 result->marks_made, marks, result->marks_not_made,
                                 result->message));
  }
}

void Participants::checkInPosition() {
  for (std::size_t i = never_in_position_.value_or(moves_.size()); i < moves_.size(); ++i) {
    const auto& [name, move] = moves_[i];
    const auto result = move.outcome->get();
    if (name.rfind("move z", 0) == 0 && result && result->end == axis::MoveEnd::kReached) {
      oracle_.complain(name + " is said to be done, but the driver was never in position");
    }
  }
}

void Participants::probe() {
  Meaning all;
  all.axes.fill(true);
  if (closed_) {
    Meaning rest = all;
    rest.quiet = Meaning::Quiet::kAtRest;
    ask("await rest", machine::AwaitRest{}, rest);
    return;
  }
  Meaning recovers = all;
  recovers.recovers = true;
  activity::Reply recovered = ask("recover", machine::Recover{}, recovers);
  if (recovered.failure) {
    // The watcher may only now have seen that the emergency stop was released.
    const pulse::Nanoseconds later = clock_.now() + kInputPeriod;
    playUntil([&] { return clock_.now() >= later; }, kLongestCall);
    recovered = ask("recover", machine::Recover{}, recovers);
  }
  if (recovered.failure) oracle_.complain("recover: " + recovered.failure->text);
  for (std::size_t axis = 0; axis < kAxes; ++axis) leaveSharedSwitch(axis);
  for (std::size_t axis = 0; axis < kAxes && oracle_.complaints.empty(); ++axis) probeAxis(axis);
}

// Somebody does what the refusals of an axis say whose ends share a switch.
bool Participants::leaveSharedSwitch(std::size_t axis) {
  const sim::RigAxisReport seen = rig_.report(configs_[axis].name);
  const bool is_pressed = seen.min_pressed || seen.max_pressed;
  if (configs_[axis].switch_release == 0.0 || !is_pressed) return false;
  ask("disable", machine::Enable{{axis}, false}, {});
  rig_.placeCarriage(configs_[axis].name, 0.0, clock_.now());
  return true;
}

void Participants::probeAxis(std::size_t axis) {
  const std::string& name = configs_[axis].name;
  const auto must = [&](const std::string& what, machine::Request request, bool moves = false) {
    Meaning meaning;
    meaning.axes[axis] = true;
    meaning.moves = moves;
    const activity::Reply reply = ask(what, std::move(request), meaning);
    if (reply.failure) oracle_.complain(name + ": " + what + ": " + reply.failure->text);
  };
  must("all limits", machine::SetLimits{axis, {}});
  must("override 1", machine::SetSpeedOverride{1.0});
  if (configs_[axis].pins.sleep.wired()) must("wake", machine::Sleep{axis, false});
  must("enable", machine::Enable{{axis}, true});
  // Its rotor may have turned to the next full step, and onto the switch.
  if (leaveSharedSwitch(axis)) must("enable", machine::Enable{{axis}, true});
  const double before = rig_.report(name).carriage;
  // At its block it may have lost steps, and count itself anywhere.
  if (meetsBlock(configs_[axis])) must("set position", machine::SetPosition{axis, 0.0});
  const double way = before > 3.0 ? -0.002 : 0.002;
  const std::size_t moves = moves_.size();
  must("move", machine::MoveTo{axis, way, true, 0.0}, true);
  if (moves_.size() == moves) return;
  const axis::Move move = moves_.back().second;
  playUntil([&] { return move.outcome->get().has_value(); }, kLongestCall);
  const auto result = move.outcome->get();
  if (!result || result->end != axis::MoveEnd::kReached) {
    oracle_.complain(name + " doesn't reach its target in the end: " +
                     (result ? result->message : "it takes too long"));
    return;
  }
  const double moved = std::abs(rig_.report(name).carriage - before);
  const double most = 1.3 + 1e3 * (roundingOf(axis) - 1.0) / configs_[axis].steps_per_unit;
  if (std::abs(moved - 2.0) > most) {
    oracle_.complain(name + " was to move 2 mm, but its carriage has moved " +
                     std::to_string(moved) + " mm");
  }
}

// Polls of registers never end: nothing else will come, as all is held.
bool Participants::isStuck() {
  if (!hasRegisters(configs_) || !controller_->snapshot()->axes.front().state.held) return false;
  const bool all_wait = std::all_of(clients_.begin(), clients_.end(), [](const Client& client) {
    return client.idle() || (client.waits() && !client.waits_for_stops);
  });
  const bool next_waits =
      next_item_ == schedule_.items.size() ||
      clients_[static_cast<std::size_t>(schedule_.items[next_item_].client)].waits();
  if (!all_wait || !next_waits || !requests_.empty() || !jobs_.empty()) return false;
  for (std::size_t i = 0; i < kAxes; ++i) {
    if (engine_->channel(static_cast<int>(i)).following != 0) return false;
  }
  return !core_->hasNews();
}

std::vector<std::string> Participants::run() {
  Meaning none;
  const activity::Reply up = ask("bring up", machine::BringUp{}, none);
  if (up.failure) oracle_.complain("bring up: " + up.failure->text);
  for (std::size_t i = 0; i < kAxes; ++i) {
    ask("set position", machine::SetPosition{i, 0.0}, none);
  }
  playUntil([this] { return atRest(); }, kLongestCall);
  position_changed_ = false;
  script_began_ = item_step_ = steps_;
  script_ = true;
  lines_of_log_.clear();
  const auto played = [this] {
    return next_item_ == schedule_.items.size() && clients_[0].idle() && clients_[1].idle();
  };
  // Held goals are answered when they continue, or are stopped.
  const auto held = [this] {
    return !clients_[0].waits_for_stops && !clients_[1].waits_for_stops &&
           controller_->snapshot()->axes.front().state.held;
  };
  // An item may wait for the slow motion of the one before it.
  const auto longest = kLongestCall * static_cast<pulse::Nanoseconds>(
                                          std::max<std::size_t>(1, schedule_.items.size()));
  const auto over = [&] { return played() || isStuck(); };
  if (!playUntil(over, longest) && !held() && !schedule_.may_last) {
    for (const auto& [id, asked] : open_) oracle_.complain(asked.name + " isn't answered");
    for (const Client& client : clients_) {
      if (client.waits_for_stops) oracle_.complain("the emergency stop isn't answered");
    }
    if (oracle_.complaints.empty()) oracle_.complain("the script doesn't come to its end");
  }
  // The promises of the last answers must remain true for a while.
  const pulse::Nanoseconds later = clock_.now() + kQuietIsWatched;
  if (oracle_.complaints.empty()) {
    playUntil([&] { return clock_.now() >= later; }, kLongestCall);
  }
  script_ = false;
  if (oracle_.complaints.empty() && !schedule_.may_last) checkEnds();
  if (oracle_.complaints.empty()) {
    checkInPosition();
    checkPower();
    for (std::size_t i = 0; i < kAxes; ++i) rig_.setFaults(configs_[i].name, {});
    pressEmergencyStop(false);
    checkTroubles();
    mendLines();
    next_pin_error_ = 0;
    next_pin_hang_ = 0;
    Meaning stops;
    stops.axes.fill(true);
    stops.quiet = Meaning::Quiet::kSlowsDown;
    stops.ends_hold = true;
    note("stop all in the end");
    ask("stop", machine::StopAll{}, stops);
    if (!playUntil([this] { return atRest(); }, kLongestCall)) {
      oracle_.complain("the axes don't come to rest, or an outcome isn't set");
    }
  }
  if (oracle_.complaints.empty()) checkOutcomes();
  if (oracle_.complaints.empty()) checkCounts("at rest");
  if (oracle_.complaints.empty()) checkRest();
  if (oracle_.complaints.empty()) checkRegisters();
  if (oracle_.complaints.empty()) checkMarks();
  if (oracle_.complaints.empty()) checkCompared();
  if (oracle_.complaints.empty()) checkLatches();
  for (std::size_t axis = 0; axis < kAxes && oracle_.complaints.empty(); ++axis) checkHull(axis);
  if (oracle_.complaints.empty()) {
    loses_edges_ = false;
    note("probe");
    probe();
  }
  if (oracle_.complaints.empty()) checkRegisters();
  if (oracle_.complaints.empty()) checkCounts("in the end");
  for (std::size_t axis = 0; axis < kAxes && oracle_.complaints.empty(); ++axis) checkHull(axis);
  return oracle_.complaints;
}

}  // namespace stepdriver::search
