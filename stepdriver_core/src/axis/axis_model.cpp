#include "axis_model.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

#include "config/restart_speed.h"
#include "gpio/chip_table.h"
#include "message_text.h"
#include "profile/resting_count.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"
#include "trajectory/backlash.h"

namespace stepdriver::axis {
AxisModel::AxisModel(config::AxisConfig axis_config, const motor::MotorLines& motor_lines,
                     int channel, const MachineMode& machine_mode, const InputLevels& input_levels,
                     const LineNames& line_names)
    : config(std::move(axis_config)),
      motor(config, motor_lines, channel),
      mode(machine_mode),
      inputs(input_levels),
      lines(line_names),
      limits_{config.max_speed, config.acceleration, config.deceleration, config.jerk} {}

// ---- scales ----

double AxisModel::stepsPerUnit(int microsteps) const {
  return config.steps_per_unit * (static_cast<double>(microsteps) / config.microsteps);
}

std::int64_t AxisModel::backlash() const {
  return motion::restingCount(exactBacklash(motor.microsteps()));
}

double AxisModel::takenUp() const {
  const double whole = exactBacklash(motor.microsteps());
  return whole > 0.0 ? motor.state().taken_up / whole : 0.0;
}

double AxisModel::takenUpIn(int microsteps, double part) const {
  const double whole = exactBacklash(microsteps);
  // In this sum the digits are lost that steps would lose later, when they are added.
  return (std::clamp(part, 0.0, 1.0) * whole + whole) - whole;
}

double AxisModel::jointAt(double motor_count) const {
  const pulse::ChannelState& state = motor.state();
  const double slack =
      static_cast<double>(state.slack) + motor_count - static_cast<double>(state.count);
  return motor_count - std::clamp(slack, 0.0, static_cast<double>(backlash()));
}

double AxisModel::jointAtTime(std::int64_t at) const {
  const motor::MotionHistory::Part& part = motor.history().at(at);
  if (!part.moved) return part.place - part.slack;
  const double place = part.motion.made().stateAt(at).position.value();
  if (backlash() == 0) return place;
  const auto slack = motion::slackAt(*part.motion.plan(), at, backlash());
  return slack ? place - *slack : jointAt(place);
}

int AxisModel::directionAtTime(std::int64_t at) const {
  constexpr std::int64_t kAround = 1'000'000;
  // [microsteps] An axis that moves less in that time passes nothing.
  constexpr double kLeastWay = 1e-3;
  const double here = jointAtTime(at);
  const double before = here - jointAtTime(at - kAround);
  const double after = jointAtTime(at + kAround) - here;
  if (before > kLeastWay && after > kLeastWay) return 1;
  return before < -kLeastWay && after < -kLeastWay ? -1 : 0;
}

motion::PathAxis AxisModel::pathAxis() const {
  motion::PathAxis facts;
  facts.name = config.name;
  facts.kind = config.kind;
  facts.shares_motors = !sharers_.empty();
  facts.microsteps = motor.microsteps();
  facts.steps_per_unit = stepsPerUnit();
  facts.origin = position.origin();
  facts.continuous = config.continuous;
  facts.min_position = config.min_position;
  facts.max_position = config.max_position;
  facts.min_position_source = config.min_position_source;
  facts.max_position_source = config.max_position_source;
  facts.configured_backlash = config.backlash;
  facts.backlash = backlash();
  facts.limits = limits(maxSpeed());
  facts.max_speed_source = maxSpeedSource();
  facts.stop_limits = stopLimits();
  return facts;
}

motion::PathStart AxisModel::pathStart(std::int64_t at) const {
  motion::PathStart start;
  start.motor = motor.stateAt(at);
  const double count = start.motor.position.value();
  start.slack = count - jointAt(count);
  start.moves = moving();
  return start;
}

motion::PathStart AxisModel::laterPathStart(std::int64_t at) const {
  const motor::Motion* latest = motor.motions().latest();
  return latest != nullptr ? laterPathStart(at, *latest->planned.plan()) : pathStart(at);
}

motion::PathStart AxisModel::laterPathStart(std::int64_t at, const motion::Profile& planned) const {
  motion::PathStart start;
  start.motor = planned.stateAt(at);
  const double count = start.motor.position.value();
  start.slack = motion::slackAt(planned, at, backlash()).value_or(count - jointAt(count));
  start.moves = at < planned.endNs();
  return start;
}

// ---- limits ----

double AxisModel::maxSpeed() const { return std::min(limits_.max_speed, chipsMaxSpeed()); }

double AxisModel::chipsMaxSpeed() const {
  const double period = static_cast<double>(config.shortestStepNs()) * 1e-9;
  return 1.0 / (period * stepsPerUnit());
}

config::LimitSource AxisModel::maxSpeedSource() const {
  if (maxSpeed() < limits_.max_speed) return config::LimitSource::kChip;
  if (limits_.max_speed < config.max_speed) return config::LimitSource::kSetLimits;
  return config.max_speed_source;
}

motion::MotionLimits AxisModel::limits(double velocity) const {
  const double scale = stepsPerUnit();
  return {config.start_speed * scale, velocity * scale, limits_.acceleration * scale,
          limits_.deceleration * scale, limits_.jerk * scale};
}

motion::MotionLimits AxisModel::stopLimits() const {
  const double scale = stepsPerUnit();
  return {config.start_speed * scale, std::min(config.max_speed, chipsMaxSpeed()) * scale,
          config.acceleration * scale,
          config.stop_deceleration.value_or(config.deceleration) * scale, config.jerk * scale};
}

pulse::Nanoseconds AxisModel::restartInterval() const {
  return static_cast<pulse::Nanoseconds>(1e9 / (config::restartSpeed(config) * stepsPerUnit()));
}

void AxisModel::refuseTooLow(const char* what, double wanted, double lowest,
                             const char* per) const {
  // The bound must not be below itself after the configuration's rounding.
  const double bound = lowest / config.steps_per_unit;
  if (wanted == 0.0 || wanted * (1.0 + 1e-9) >= bound) return;
  refuse(fmt::format("the {0} {1} is below the lowest, {2} {3}{4}, which is {5} steps{4}", what,
                     show(wanted, per), lowerBoundText(bound), config::unitOf(config.kind), per,
                     numberText(lowest)));
}

double AxisModel::checkedLimit(const char* what, double wanted, double configured, double lowest,
                               const char* per, config::LimitSource source) const {
  if (!std::isfinite(wanted) || wanted < 0.0) {
    refuse(fmt::format(
        "the {} is {}, but must be a finite number above 0, or 0 for the configured one", what,
        show(wanted, per)));
  }
  refuseTooLow(what, wanted, lowest, per);
  // If no jerk limit is configured, any jerk is allowed.
  if (configured > 0.0 && wanted > configured * (1.0 + 1e-12)) {
    refuse(fmt::format("the {} {} is above {}", what, show(wanted, per),
                       pathAxis().showLimit(configured, source, per)));
  }
  return wanted > 0.0 ? wanted : configured;
}

AxisLimits AxisModel::checkedLimits(const AxisLimits& wanted) const {
  AxisLimits next;
  next.max_speed = checkedLimit("max_speed", wanted.max_speed, config.max_speed,
                                config::kLowestRate, "/s", config.max_speed_source);
  next.acceleration = checkedLimit("acceleration", wanted.acceleration, config.acceleration,
                                   config::kLowestAcceleration, "/s^2");
  next.deceleration = checkedLimit("deceleration", wanted.deceleration, config.deceleration,
                                   config::kLowestAcceleration, "/s^2");
  next.jerk = checkedLimit("jerk", wanted.jerk, config.jerk, config::kLowestJerk, "/s^3");
  return next;
}

// ---- refusals ----

void AxisModel::refuse(const std::string& why) const { throw Refused(config.name + ": " + why); }

void AxisModel::refuseUnlessOpen() const {
  if (!mode.closed.empty()) refuse(mode.closed);
}

void AxisModel::refuseWhileHeld() const {
  if (mode.held) refuse("the machine is on hold; resume or stop it first");
}

void AxisModel::refuseUnlessHomed() const {
  if (!config.require_homing || position.isHomed()) return;
  refuse(
      "it isn't homed, and require_homing allows absolute positions only after a homing; home it "
      "first");
}

void AxisModel::refuseUnlessReady() const {
  refuseUnlessOpen();
  if (fault) refuse("at fault: " + fault.what() + "; call recover first");
  if (!motor.power().wantsEnabled()) refuse("disabled; enable it first");
  if (motor.power().wantsSleep()) refuse("asleep; wake it first");
  if (sharerAtFault() != nullptr) refuse(faultText() + "; call recover first");
  for (const AxisModel* sharer : switch_sharers_) {
    if (!sharer->is_being_homed) continue;
    refuse(sharer->name() + ", which has a switch on the same line, is being homed: wait for it");
  }
  for (const AxisModel* sharer : sharers_) {
    const motor::Power& power = sharer->motor.power();
    const char* const why = !power.wantsEnabled() ? "disabled; enable it first"
                            : power.wantsSleep()  ? "asleep; wake it first"
                                                  : nullptr;
    if (why != nullptr) refuse(sharer->name() + ", which shares its motors, is " + why);
  }
}

void AxisModel::refuseUnlessFinite(const char* what, double value, const char* per) const {
  if (std::isfinite(value)) return;
  refuse(fmt::format("the {} is {}, but must be a finite number", what, show(value, per)));
}

void AxisModel::refuseTooFast(double speed) const {
  if (speed <= maxSpeed() * (1.0 + 1e-12)) return;
  refuse(fmt::format("the velocity {} is above the maximum {}", show(speed, "/s"),
                     pathAxis().showLimit(maxSpeed(), maxSpeedSource(), "/s")));
}

double AxisModel::checkedVelocity(double velocity) const {
  if (!std::isfinite(velocity) || velocity < 0.0) {
    refuse(
        fmt::format("the velocity is {}, but must be a finite number above 0, or 0 for the maximum",
                    show(velocity, "/s")));
  }
  refuseTooLow("velocity", velocity, config::kLowestRate, "/s");
  refuseTooFast(velocity);
  return velocity > 0.0 ? std::min(velocity, maxSpeed()) : maxSpeed();
}

void AxisModel::refuseIntoEndstop(std::int64_t steps) const {
  if (steps == 0 || !isStoppedAt(steps > 0)) return;
  if (config.switch_release > 0.0 && !motor.state().pressed) {
    refuse(
        "the switch of both ends is pressed, and it isn't known at which one; move the axis off it "
        "by hand, while its motor has no current");
  }
  refuse(fmt::format("{} is active; it moves only towards {}", endstopText(steps > 0),
                     steps > 0 ? "min" : "max"));
}

void AxisModel::refuseHomingOnSharedSwitch() const {
  if (config.homing->kind == config::HomingKind::kDirect) return;
  for (const bool at_max : {false, true}) {
    const AxisModel* const other = sharerOfSwitch(at_max);
    if (other == nullptr || !anyEndstopActive(at_max)) continue;
    refuse(
        fmt::format("the switch that it shares with {} is pressed, and it isn't known by which "
                    "of them: first move the one off it that presses it",
                    other->name()));
  }
  if (config.switch_release == 0.0 || !anyEndstopActive(false)) return;
  const bool at_max = config.homing->at_max;
  if (!motor.state().pressed) refuseIntoEndstop(at_max ? 1 : -1);
  if (config.homing->kind != config::HomingKind::kLimit || isStoppedAt(at_max)) return;
  refuse(
      fmt::format("the switch of both ends is pressed at {}, and not where it is homed: first "
                  "move it off",
                  at_max ? "min" : "max"));
}

const AxisModel* AxisModel::sharerOfSwitch(bool at_max) const {
  const motor::MotorLines& own = motor.lines();
  const int line = at_max ? own.endstop_max : own.endstop_min;
  const auto sharer =
      std::find_if(switch_sharers_.begin(), switch_sharers_.end(), [line](const AxisModel* other) {
        const motor::MotorLines& others = other->motor.lines();
        return others.endstop_min == line || others.endstop_max == line;
      });
  return line >= 0 && sharer != switch_sharers_.end() ? *sharer : nullptr;
}

std::string AxisModel::endstopText(bool at_max) const {
  const std::string text = at_max ? "the max endstop" : "the min endstop";
  const AxisModel* const sharer = sharerOfSwitch(at_max);
  return sharer != nullptr ? text + ", or that of " + sharer->name() + " on the same line," : text;
}

void AxisModel::refuseMicrosteps(int wanted) const {
  if (config.kinematics) {
    refuse(
        fmt::format("it shares its motors, and keeps its microsteps, 1/{}: its place may be "
                    "between microsteps of each, which another mode doesn't have",
                    motor.microsteps()));
  }
  if (config.motors() > 1) {
    refuse(
        fmt::format("it has {} motors, and keeps its microsteps, 1/{}: after a squaring the "
                    "motors may be at different microsteps, which another mode doesn't have",
                    config.motors(), motor.microsteps()));
  }
  const driver::DriverChip& chip = config.driver;  // the chip of the only motor
  const bool by_registers = config.tmc.has_value();
  const std::vector<int> known =
      by_registers ? chip.microsteps : driver::selectableMicrosteps(chip);
  if (known.empty()) {
    refuse(
        fmt::format("it can't change to {} microsteps: those of the {} are set by its DIP switches "
                    "while its power is off, and configured as `microsteps`, here {}",
                    wanted, chip.title, motor.microsteps()));
  }
  if (std::find(known.begin(), known.end(), wanted) == known.end()) {
    refuse(fmt::format("the {} has no 1/{} mode; it has {}", chip.title, wanted,
                       fmt::join(known, ", ")));
  }
  if (!by_registers && !motor.pins().hasMode()) {
    refuse(
        fmt::format("it can't change to {} microsteps: the microstep pins aren't configured, so "
                    "that the board decides, here {}",
                    wanted, motor.microsteps()));
  }
}

// ---- lines ----

std::optional<bool> AxisModel::endstopActive(std::size_t motor_index, bool at_max) const {
  const config::MotorConfig& side = config.motorAt(motor_index);
  const motor::ChipLines& own = motor.lines().motorAt(motor_index);
  const auto& endstop = at_max ? side.endstop_max : side.endstop_min;
  if (!endstop) return std::nullopt;
  return (readInput(at_max ? own.endstop_max : own.endstop_min) != 0) == endstop->active_level;
}

bool AxisModel::anyEndstopActive(bool at_max) const {
  for (std::size_t i = 0; i < config.motors(); ++i) {
    if (endstopActive(i, at_max).value_or(false)) return true;
  }
  return false;
}

bool AxisModel::isStoppedAt(bool at_max) const {
  if (!anyEndstopActive(at_max)) return false;
  const auto pressed = motor.state().pressed;
  const auto end = at_max ? pulse::AxisEnd::kMax : pulse::AxisEnd::kMin;
  return config.switch_release == 0.0 || !pressed || *pressed == end;
}

std::string AxisModel::chipText(std::size_t motor_index) const {
  const std::string title = "the " + chipAt(motor_index).title;
  if (!sharers_.empty()) {
    return title + " of " + (motor_index == 0 ? *this : *sharers_.at(motor_index - 1)).name();
  }
  const std::string& name = config.motorAt(motor_index).motor;
  return title + (name.empty() ? "" : " of motor " + name);
}

const driver::DriverChip& AxisModel::chipAt(std::size_t motor_index) const {
  if (sharers_.empty()) return config.motorAt(motor_index).driver;
  return (motor_index == 0 ? *this : *sharers_.at(motor_index - 1)).config.driver;
}

motor::TmcChip* AxisModel::registersAt(std::size_t motor_index) {
  if (sharers_.empty()) return motor.tmcAt(motor_index);
  return (motor_index == 0 ? *this : *sharers_.at(motor_index - 1)).motor.tmcAt(0);
}

int AxisModel::readInput(int line) const {
  const int level = inputs.level(line);
  if (level < 0) throw GpioError(config.name + ": " + failureText({-level, line, true}));
  return level;
}

std::string AxisModel::lostLineText() const {
  if (!lines.failure) return "";
  for (std::size_t i = 0; i < motor.lines().motors(); ++i) {
    const int step = motor.lines().motorAt(i).step;
    if (step >= 0 && !lines.failure(false, step).empty()) return failureText({ENODEV, step, false});
  }
  return "";
}

std::string AxisModel::failureText(const pulse::LineFailure& failure) const {
  if (!isLineOf(failure, motor.lines())) {
    for (const AxisModel* sharer : sharers_) {
      if (!isLineOf(failure, sharer->motor.lines())) continue;
      return sharer->name() + ": " +
             lineFailureText(failure, sharer->config, sharer->motor.lines(), lines);
    }
  }
  return lineFailureText(failure, config, motor.lines(), lines);
}

// ---- axes that share motors ----

void AxisModel::shareMotors(const std::vector<AxisModel*>& axes) {
  sharing_ = axes;
  const std::size_t own = config.kinematics->numberOf(name());
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (i != own) sharers_.push_back(axes[i]);
    reach_ += 0.5 * std::abs(config.kinematics->inverse[own][i]) * config.steps_per_unit /
              axes[i]->config.steps_per_unit;
  }
}

double AxisModel::plannedEnd() const {
  const motor::Motion* last = motor.motions().latest();
  return last != nullptr ? last->planned.plan()->endPosition().value() : restCount();
}

// Each motor makes a step when the sum of the axes' motions has crossed its half.
double AxisModel::restWith(const std::function<double(const AxisModel&)>& end_of) const {
  const std::size_t own = config.kinematics->numberOf(name());
  double rest = 0.0;
  for (std::size_t i = 0; i < sharing_.size(); ++i) {
    const AxisModel& driven = *sharing_[i];
    double end = 0.0;  // the end of the motor with the pins of that axis
    for (std::size_t k = 0; k < sharing_.size(); ++k) {
      end += config.kinematics->matrix[i][k] * end_of(*sharing_[k]) * driven.config.steps_per_unit /
             sharing_[k]->config.steps_per_unit;
    }
    const bool forward = end > static_cast<double>(driven.motor.state().own);
    const double count = forward ? std::ceil(end - 0.5) : std::floor(end + 0.5);
    rest += config.kinematics->inverse[own][i] * count * config.steps_per_unit /
            driven.config.steps_per_unit;
  }
  return rest;
}

pulse::Nanoseconds AxisModel::turnTime() const {
  const auto time = [](const AxisModel& axis) {
    const driver::Timing timing = axis.config.timing();
    return timing.dir_hold_ns + timing.dir_setup_ns;
  };
  pulse::Nanoseconds longest = time(*this);
  for (const AxisModel* sharer : sharers_) longest = std::max(longest, time(*sharer));
  return longest;
}

const AxisModel* AxisModel::sharerAtFault() const {
  const auto faulty = std::find_if(sharers_.begin(), sharers_.end(), [](const AxisModel* sharer) {
    return static_cast<bool>(sharer->fault);
  });
  return faulty != sharers_.end() ? *faulty : nullptr;
}

std::string AxisModel::faultText() const {
  const AxisModel* const sharer = sharerAtFault();
  if (fault || sharer == nullptr) return fault.what();
  return sharer->name() + ", which shares its motors, is at fault: " + sharer->fault.what();
}

std::string AxisModel::remedyText() const {
  const AxisModel* const sharer = sharerAtFault();
  return fault || sharer == nullptr ? fault.remedy() : sharer->fault.remedy();
}

void AxisModel::distrust() {
  position.distrust();
  for (AxisModel* sharer : sharers_) sharer->position.distrust();
}

// ---- how a motion ended ----

void AxisModel::noteEndstop(bool at_max) {
  ++endstops_met;
  stopped_by = metText(at_max) + " at " + showPlace(positionNow()) + abruptText();
}

std::string AxisModel::metText(bool at_max) const {
  const auto pressed = motor.state().pressed;
  const auto end = at_max ? pulse::AxisEnd::kMax : pulse::AxisEnd::kMin;
  if (config.switch_release == 0.0 || pressed == end) return endstopText(at_max) + " was met";
  if (!pressed) return "the switch of both ends is pressed, and it isn't known at which one,";
  return "the switch of both ends didn't open within its release travel, " +
         show(config.switch_release) + ",";
}

std::string AxisModel::abruptText() const {
  const pulse::ChannelState& state = motor.state();
  if (position.isValid() || !state.end_abrupt) return "";
  std::string text = "; it stopped too fast for the position to be trusted";
  const bool at_max = state.end == pulse::EndReason::kEndstopMax;
  if (config.kind != config::Kind::kRotary ||
      (!at_max && state.end != pulse::EndReason::kEndstopMin)) {
    return text;
  }
  return text + fmt::format(
                    "; no axis passes an endstop: if this switch closes once a turn, keep the "
                    "axis within a turn by min_position_deg and max_position_deg, or, if it "
                    "must pass the switch, remove endstops/{} and homing",
                    at_max ? "max" : "min");
}

// ---- the driver chip ----

bool AxisModel::motorHolds() const {
  const motor::Power& power = motor.power();
  return power.isEnabled() && mode.powered && !power.isAsleep() && !fault && mode.closed.empty();
}

bool AxisModel::mustWake() const {
  const motor::Brake& brake = motor.brake();
  return motor.power().isIdle() || (brake.isWired() && !brake.isReleased());
}

void AxisModel::noteUnpowered() {
  if (!config.holds_position_unpowered) distrust();
}

void AxisModel::noteHome(std::size_t motor_index) {
  if (!motor.isAtHome(motor_index)) distrust();
  motor.wentHome(motor_index);
}

void AxisModel::noteReset() {
  noteUnpowered();
  for (std::size_t i = 0; i < config.motors(); ++i) {
    if (config.motorAt(i).pins.reset.wired()) noteHome(i);
  }
}

void AxisModel::noteSupplyLost() {
  motor.forgetRegisters();
  // The pattern of coils that lines switch is no chip's.
  if (motor.hasCoils()) return noteUnpowered();
  for (std::size_t i = 0; i < config.motors(); ++i) noteHome(i);
}

void AxisModel::noteAsleep() { noteOff(&driver::DriverChip::asleep); }

void AxisModel::noteDisabled() { noteOff(&driver::DriverChip::disabled); }

void AxisModel::noteOff(driver::TranslatorState driver::DriverChip::*meanwhile) {
  noteUnpowered();
  for (std::size_t i = 0; i < config.motors(); ++i) {
    if (config.motorAt(i).driver.*meanwhile == driver::TranslatorState::kHome) noteHome(i);
  }
}

// ---- over a restart ----

AxisMemory AxisModel::memory() const {
  AxisMemory memory = rest_;
  memory.moving = moving();
  return memory;
}

void AxisModel::continueCoils(const AxisMemory& kept) {
  if (!motor.hasCoils()) return;
  for (std::size_t i = 0; i < std::min(config.motors(), kept.mscnt.size()); ++i) {
    motor.continueCoils(i, kept.mscnt[i]);
  }
}

void AxisModel::rememberRest() {
  if (moving()) return;
  rest_.kind = config.kind;
  rest_.steps_per_unit = config.steps_per_unit;
  rest_.position = positionNow();
  rest_.slack = takenUp() * config.backlash;
  rest_.valid = position.isValid();
  rest_.homed = position.isHomed();
  rest_.at_home = motor.areAtHome() &&
                  std::all_of(sharers_.begin(), sharers_.end(),
                              [](const AxisModel* sharer) { return sharer->motor.areAtHome(); });
  rest_.mscnt.clear();
  forEachPlaced([this](const motor::Motor& any, std::size_t i) {
    rest_.mscnt.push_back(any.mscntOf(i).value_or(kUnknownMscnt));
  });
}

void AxisModel::forEachPlaced(
    const std::function<void(const motor::Motor&, std::size_t)>& act) const {
  const auto each = [&act](const motor::Motor& any) {
    for (std::size_t i = 0; i < any.chips(); ++i) {
      if (any.tmcAt(i) != nullptr || any.hasCoils()) act(any, i);
    }
  };
  each(motor);
  for (const AxisModel* sharer : sharers_) each(sharer->motor);
}

AxisModel::ChipsSince AxisModel::chipsSince(const AxisMemory& kept) const {
  ChipsSince since = ChipsSince::kSame;
  std::size_t number = 0;
  forEachPlaced([&](const motor::Motor& any, std::size_t i) {
    const int then = number < kept.mscnt.size() ? kept.mscnt[number] : kUnknownMscnt;
    ++number;
    if (any.hasCoils()) {
      // The pattern has continued there, or couldn't.
      if (any.mscntOf(i) != then && since == ChipsSince::kSame) since = ChipsSince::kUnknown;
      return;
    }
    const motor::TmcChip& chip = *any.tmcAt(i);
    if (!chip.isSetUp() || !chip.keptItsPower() || then == kUnknownMscnt) {
      if (since == ChipsSince::kSame) since = ChipsSince::kUnknown;
    } else if (then != chip.mscnt()) {
      since = ChipsSince::kStepped;
    }
  });
  std::size_t motors = config.motors();
  for (const AxisModel* sharer : sharers_) motors += sharer->config.motors();
  if (number < motors && since == ChipsSince::kSame) return ChipsSince::kUnknown;
  return since;
}

std::string AxisModel::whyImpossible(const AxisMemory& kept, const std::string& source) const {
  if (kept.kind != config.kind || kept.steps_per_unit != config.steps_per_unit) {
    const auto scale = [](double steps, config::Kind kind) {
      return fmt::format("{:.9g} steps per {}", steps, config::unitOf(kind));
    };
    return fmt::format("the position was kept for another axis, of {}; this one has {}",
                       scale(kept.steps_per_unit, kept.kind),
                       scale(config.steps_per_unit, config.kind));
  }
  return pathAxis().whyBeyondLimits(kept.position, "in " + source + ", the position");
}

bool AxisModel::countsWhileDisabled() const {
  for (std::size_t i = 0; i < config.motors(); ++i) {
    if (config.motorAt(i).driver.disabled == driver::TranslatorState::kCounts) return true;
  }
  return false;
}

std::string AxisModel::whyUnverified(const AxisMemory& kept, bool clean,
                                     const std::string& source) const {
  // It may have been kept in another microstep mode, whose backlash is rounded differently.
  const double tolerance = 0.5 * config.microsteps / config.steps_per_unit;
  if (!(kept.slack >= 0.0 && kept.slack <= config.backlash + tolerance)) {
    return fmt::format("in {}, {} of the backlash is taken up, but it must be from 0 to {}", source,
                       show(kept.slack), show(config.backlash));
  }
  if (!clean && kept.moving) {
    return fmt::format(
        "the node that kept this position wasn't shut down: the axis was moving, from {}, and it "
        "is not known where it stopped",
        showPlace(kept.position));
  }
  const ChipsSince chips = chipsSince(kept);
  if (!clean) {
    const std::string text = "the node that kept this position wasn't shut down";
    if (chips == ChipsSince::kSame) return text + "; no driver has counted a step since";
    return chips == ChipsSince::kStepped ? text + ", and a driver has counted steps since" : text;
  }
  if (chips == ChipsSince::kStepped) return "a driver has counted steps since it was kept";
  if (!kept.valid) return "the position couldn't be trusted when it was kept";
  if (!config.holds_position_unpowered) {
    return "the motor had no current in between, and holds_position_unpowered isn't set";
  }
  if (config.stepsOnBothEdges() && countsWhileDisabled() && chips != ChipsSince::kSame) {
    return "each edge of STEP is a step, and the start may have made one without current";
  }
  if (!kept.at_home && chips != ChipsSince::kSame) {
    return "the chip was reset in between, which may have turned the motor by up to two full steps";
  }
  return "";
}

}  // namespace stepdriver::axis
