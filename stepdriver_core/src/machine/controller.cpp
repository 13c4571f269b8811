#include "controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "activity/driver_activities.h"
#include "axis/line_failure.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

using activity::Activity;
using activity::Goal;

constexpr const char* kPositionRemedy =
    "check what blocks the motor, and its encoder, then call recover, and home it or set its "
    "position";
constexpr const char* kOutputRemedy = "then call recover, and switch it again";
constexpr const char* kPowerRemedy =
    "check the relay, its supply and fuse, and the wiring of the feedback, then call recover";
constexpr const char* kLostStepsRemedy =
    "check what the motor moves, its current and its acceleration, call recover, and home it";

bool haveCommonSwitch(const axis::AxisModel& one, const axis::AxisModel& other) {
  const motor::MotorLines& own = one.motor.lines();
  const motor::MotorLines& others = other.motor.lines();
  const auto is_on = [](int line, const motor::MotorLines& lines) {
    return line >= 0 && (line == lines.endstop_min || line == lines.endstop_max);
  };
  return is_on(own.endstop_min, others) || is_on(own.endstop_max, others);
}

constexpr const char* kLateRemedy =
    "lower the axis's speed or the machine's load (stepdriver_check says what it can sustain), "
    "call "
    "recover, and home it or set its position";

}  // namespace

Controller::Controller(const std::vector<config::AxisConfig>& axes,
                       const std::vector<motor::MotorLines>& lines, axis::LineNames names,
                       const std::optional<pulse::Signal>& emergency_stop,
                       EmergencyDisable emergency_disable, activity::MotorPower motor_power,
                       NamedLines named, pulse::Nanoseconds horizon)
    : context_(names.inputs.size(), horizon),
      activities_(context_),
      requests_(context_, activities_, emergency_stop, std::move(named)),
      chip_watch_(
          context_, [this](const axis::AxisModel& axis) { return isBeingHomed(axis); },
          [this](axis::AxisModel& axis, const std::string& fault, const std::string& remedy) {
            failAxis(axis, fault, remedy);
          }),
      io_(std::make_shared<const IoStates>(requests_.named.states())),
      emergency_disable_(emergency_disable) {
  context_.out = &last_;
  context_.lines = std::move(names);
  context_.motor_power = std::move(motor_power);
  context_.motion_outputs = activity::MotionOutputs(requests_.named.outputs.configs());
  context_.mode.powered = context_.motor_power.isThere();
  for (std::size_t i = 0; i < axes.size(); ++i) {
    context_.axes.push_back(std::make_unique<axis::AxisModel>(
        axes[i], lines[i], static_cast<int>(i), context_.mode, context_.levels, context_.lines));
    context_.axes.back()->rememberRest();
  }
  for (const auto& axis : context_.axes) {
    if (!axis->config.kinematics) continue;
    std::vector<axis::AxisModel*> sharing;
    for (const std::string& name : axis->config.kinematics->axes) {
      const auto other = std::find_if(context_.axes.begin(), context_.axes.end(),
                                      [&](const auto& any) { return any->name() == name; });
      sharing.push_back(other->get());
    }
    axis->shareMotors(sharing);
  }
  for (const auto& axis : context_.axes) {
    std::vector<const axis::AxisModel*> sharing;
    for (const auto& other : context_.axes) {
      if (other != axis && haveCommonSwitch(*axis, *other)) sharing.push_back(other.get());
    }
    axis->shareSwitches(std::move(sharing));
  }
  flag_checks_ = FlagChecks(context_.axes);
  const std::vector<config::OutputConfig> outputs = requests_.named.outputs.configs();
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (!outputs[i].compare) continue;
    const auto axis = std::find_if(axes.begin(), axes.end(), [&](const config::AxisConfig& any) {
      return any.name == outputs[i].compare->axis;
    });
    context_.motion_outputs.compare(i, outputs[i].compare,
                                    static_cast<std::size_t>(axis - axes.begin()), nullptr);
  }
}

Controller::~Controller() { context_.out = &last_; }

void Controller::handle(const Input& input, activity::Outputs& out) {
  context_.now = input.now;
  context_.slipped = input.slipped;
  context_.stops_asked = input.stops_asked;
  context_.beginTurn(out);
  std::visit([this](const auto& what) { on(what); }, input.what);
  // Before motions that begin in this turn.
  superviseCompares();
  pollLatches();
  checkFlags();
  activities_.poll();
  supervise();
  while (supervisePower() || superviseOutputs()) {
  }
  superviseCompares();
  requests_.named.inputs.poll(context_);
  pollLatches();  // a motion that has ended now ends its latch
  showIo();
  if (!requests_.named.outputs.areBeingWritten()) stops_concluded_ = context_.stops_handled;
  context_.pin_done.reset();
  context_.register_done.reset();
  for (const auto& axis : context_.axes) axis->rememberRest();
  if (!requests_.awaiting_rest.empty()) {
    const bool rests = std::none_of(context_.axes.begin(), context_.axes.end(),
                                    [](const auto& axis) { return axis->moving(); });
    if (rests) requests_.awaiting_rest.clear();
  }
  context_.endTurn();
  context_.beginTurn(last_);
}

void Controller::pollLatches() {
  for (const PositionLatches::Ending& ending : requests_.latches.poll(context_)) {
    for (const axis::AxisModel* axis : ending.axes) {
      activities_.end(*axis, {axis::MoveEnd::kStopped, ending.why});
    }
  }
}

void Controller::checkFlags() {
  const auto findings = flag_checks_.poll(
      context_, [this](const axis::AxisModel& axis) { return isBeingHomed(axis); });
  for (const FlagChecks::Finding& finding : findings) {
    if (finding.axis->config.homing->check_at_flag == config::FlagCheck::kFault) {
      failAxis(*finding.axis, finding.text, kLostStepsRemedy);
    } else {
      finding.axis->position.warn(finding.text);
    }
  }
}

bool Controller::isBeingHomed(const axis::AxisModel& axis) const {
  const Activity* const owner = activities_.owner(axis);
  return owner != nullptr && owner->homingPhase() != axis::HomingPhase::kNone;
}

pulse::Nanoseconds Controller::due() const {
  pulse::Nanoseconds due =
      std::min({activities_.due(), context_.motor_power.due(), requests_.named.outputs.due(),
                requests_.named.inputs.due(), requests_.latches.due(), flag_checks_.due()});
  for (const auto& axis : context_.axes) due = std::min(due, idleDue(*axis));
  return due;
}

// ---- the engine ----

void Controller::on(const EngineNews& news) {
  handleStops(news);
  for (std::size_t i = 0; i < news.channels.size(); ++i)
    update(*context_.axes.at(i), news.channels[i]);
  context_.motion_outputs.update(news.outputs);
  // A path whose last mark has failed has not reached its end.
  superviseOutputs();
}

void Controller::handleStops(const EngineNews& news) {
  const bool by_input = news.input_stops != input_stops_seen_;
  const auto latch = [&] {
    for (const auto& axis : context_.axes) {
      if (!axis->fault) axis->noteStop();
      axis->fault.latchEmergencyStop(by_input);
    }
  };
  if (news.stops_ramping != context_.stops_ramping) {
    context_.stops_ramping = news.stops_ramping;
    latch();
  }
  if (news.stops_served == context_.stops_handled) return;
  context_.stops_handled = news.stops_served;
  input_stops_seen_ = news.input_stops;
  disables_all_ = emergency_disable_ != EmergencyDisable::kHold;
  context_.motor_power.stopped(context_);
  latch();
}

void Controller::update(axis::AxisModel& axis, const pulse::ChannelState& state) {
  const pulse::ChannelState before = axis.motor.state();
  axis.motor.update(state);
  const bool was_faulty = static_cast<bool>(axis.fault);
  if (state.accepted != before.accepted) axis.stopped_by.clear();
  if (state.line_errors != before.line_errors) {
    axis.fault.latch(axis.failureText(state.failure), "then call recover");
    axis.distrust();
    axis.motor.doubtPins();
  }
  if (state.chip_faults != before.chip_faults && !axis.motor.power().isAsleep() &&
      context_.mode.powered) {
    axis.fault.latch(
        fmt::format("{} reports a fault on {}, such as over-current or over-temperature",
                    axis.chipText(state.chip_at_fault),
                    axis.chipAt(state.chip_at_fault).fault_name),
        kChipRemedy);
    axis.distrust();
    chip_watch_.askForCause(axis, state.chip_at_fault);
  }
  if (state.ended != before.ended) {
    axis.rest_since = std::min(context_.now, state.end_time + context_.slipped);
    if (state.end == pulse::EndReason::kEmergencyStop) axis.fault.latchEmergencyStop(false);
    if (state.end == pulse::EndReason::kTooLate) {
      axis.fault.latch(
          fmt::format("a pulse was {} late, too much for the motor to continue at this speed",
                      millisecondsText(state.end_lateness)),
          kLateRemedy);
      axis.distrust();
    }
    if (state.end == pulse::EndReason::kNotInPosition) {
      axis.fault.latch(
          fmt::format("{} isn't in position: {} was still inactive {} after the "
                      "end of the motion",
                      axis.chipText(state.unsettled), axis.chipAt(state.unsettled).in_position_name,
                      millisecondsText(state.waited)),
          kPositionRemedy);
      axis.distrust();
    }
    if (state.end_abrupt && state.end != pulse::EndReason::kDone) axis.distrust();
    const bool at_max = state.end == pulse::EndReason::kEndstopMax;
    const bool is_met = at_max || state.end == pulse::EndReason::kEndstopMin;
    if (is_met && !isBeingHomed(axis)) axis.noteEndstop(at_max);
  }
  if (!was_faulty && axis.fault) axis.noteStop();
}

void Controller::on(const EngineHangs& hang) {
  const std::string text = textOf(hang.line);
  for (const auto& axis : context_.axes) {
    axis->fault.latchOfMachine(text, "then call recover");
    axis->position.distrust();
    axis->noteStop();
  }
}

std::string Controller::textOf(const pulse::LineFailure& failure) const {
  if (failure.line < 0) return "the thread that makes the pulses hangs, at none of its lines";
  std::string of_output =
      failure.input ? "" : requests_.named.outputs.failureText(failure, context_.lines);
  if (!of_output.empty()) return of_output;
  const auto owner = std::find_if(
      context_.axes.begin(), context_.axes.end(),
      [&failure](const auto& axis) { return axis::isLineOf(failure, axis->motor.lines()); });
  if (owner == context_.axes.end()) return context_.axes.front()->failureText(failure);
  return (*owner)->config.name + ": " + (*owner)->failureText(failure);
}

// Starts what the current state requires without a request.
void Controller::supervise() {
  for (const auto& axis : context_.axes) {
    if (axis->fault && !activities_.isFree(*axis)) {
      const auto end =
          axis->fault.isEmergencyStop() ? axis::MoveEnd::kEmergencyStop : axis::MoveEnd::kFault;
      activities_.end(*axis, {end, axis->fault.what()});
    }
    const bool by_sharer = !axis->fault && !axis->faultText().empty();
    if (by_sharer && (axis->moving() || activities_.heir(*axis) != nullptr)) {
      activities_.end(*axis, {axis::MoveEnd::kFault, axis->faultText()});
    }
    if (disables_all_ && axis->motor.pins().hasEnable()) {
      requests_.disable(*axis, {axis::MoveEnd::kEmergencyStop, axis->fault.what()}, nullptr);
    }
    // The outputs of a chip at fault are off, and a motor that was stopped at speed may have
    // stalled.
    if (axis->fault && axis->motor.brake().isReleased() && activities_.isFree(*axis)) {
      activities_.begin(std::make_unique<activity::EngageBrake>(context_, *axis, nullptr),
                        kTakenOver);
    }
    superviseIdle(*axis);
    chip_watch_.supervise(*axis);
  }
  disables_all_ = false;
  activities_.poll();
}

// @return whether it has got on: the activities have looked at it.
bool Controller::supervisePower() {
  activity::MotorPower& power = context_.motor_power;
  if (!power.poll(context_, motorsMayLosePower())) return false;
  if (const std::string failure = power.takeFailure(); !failure.empty()) {
    context_.out->stops = true;
    for (const auto& axis : context_.axes) {
      axis->fault.latchOfMachine(failure, kPowerRemedy);
      axis->noteStop();
    }
  }
  activities_.poll();
  supervise();
  return true;
}

// Each brake that can be engaged holds by now, and each motor that must be disabled is.
bool Controller::motorsMayLosePower() const {
  return std::all_of(context_.axes.begin(), context_.axes.end(), [this](const auto& axis) {
    const motor::Brake& brake = axis->motor.brake();
    if (axis->moving() || brake.isReleased() || context_.now < brake.settles()) return false;
    if (!context_.mode.closed.empty()) return activities_.isFree(*axis);
    for (const Activity* busy : {activities_.owner(*axis), activities_.heir(*axis)}) {
      if (busy != nullptr && busy->work() == Activity::Work::kDisables) return false;
    }
    return true;
  });
}

// @return whether one has failed, which others must look at too.
bool Controller::superviseOutputs() {
  NamedOutputs& outputs = requests_.named.outputs;
  if (outputs.empty()) return false;
  const std::string failure = outputs.poll(context_, requests_.whySafe());
  if (failure.empty()) return false;
  for (const auto& axis : context_.axes) {
    axis->fault.latchOfMachine(failure, kOutputRemedy);
    axis->noteStop();
  }
  activities_.poll();
  supervise();
  return true;
}

// While an axis is homed, its count means no place.
void Controller::superviseCompares() {
  if (requests_.named.outputs.empty()) return;
  context_.motion_outputs.supervise(
      context_, requests_.whySafe(),
      [this](const axis::AxisModel& axis) { return !isBeingHomed(axis); });
}

void Controller::showIo() {
  IoStates now = requests_.named.states();
  if (now != *io_) io_ = std::make_shared<const IoStates>(std::move(now));
}

pulse::Nanoseconds Controller::idleDue(const axis::AxisModel& axis) const {
  const motor::Power& power = axis.motor.power();
  const bool stays = axis.config.idle_timeout <= 0.0 || power.isIdle() || !power.wantsEnabled() ||
                     power.wantsSleep() || axis.fault || !context_.mode.closed.empty() ||
                     context_.mode.held || !activities_.isFree(axis) ||
                     activities_.schedule().has(axis);
  if (stays) return pulse::kNever;
  return axis.rest_since + nanoseconds(axis.config.idle_timeout);
}

void Controller::superviseIdle(axis::AxisModel& axis) {
  if (context_.now < idleDue(axis)) return;
  activities_.begin(std::make_unique<activity::GoIdle>(context_, axis), kTakenOver);
}

void Controller::on(const bus::RegisterDone& done) {
  context_.register_done = done;
  const auto change = requests_.setting_changes.extract(done.id);
  if (!change) return chip_watch_.take(done);
  const RequestContext::SettingChange& setting = change.mapped();
  axis::AxisModel& axis = *context_.axes.at(setting.axis);
  const std::string why = chip_watch_.takeSetting(axis, setting.motor, done);
  if (why.empty()) return;
  setting.call->fail({activity::Failure::Kind::kGpio,
                      axis.name() + ": " + axis.chipText(setting.motor) + " " + why});
}

void Controller::failAxis(axis::AxisModel& axis, const std::string& fault,
                          const std::string& remedy) {
  axis.distrust();
  if (axis.fault) return;
  axis.fault.latch(fault, remedy);
  axis.noteStop();
  pulse::Command command;
  command.kind = pulse::Command::Kind::kFault;
  command.channel = axis.motor.channel();
  command.serial = axis.motor.nextSerial();
  context_.out->commands.push_back(command);
}

// ---- requests ----

void Controller::on(const Requested& requested) {
  const SharedCall call = std::make_shared<activity::PendingCall>(context_, requested.call);
  try {
    serve(requested.request, requests_, call);
  } catch (const Error& error) {
    call->fail(activity::failureOf(error));
  }
}

// ---- what readers see ----

AxisSnapshot Controller::snapshotOf(const axis::AxisModel& axis) const {
  const motor::Power& power = axis.motor.power();
  const Activity* owner = activities_.owner(axis);
  AxisSnapshot shown;
  axis::AxisState& state = shown.state;
  state.enabled = power.isEnabled() && context_.mode.powered;
  state.powered = context_.mode.powered;
  state.brake_engaged = axis.motor.brake().isWired() && !axis.motor.brake().isReleased();
  state.asleep = power.isAsleep();
  state.idle = power.isIdle();
  state.moving = axis.moving();
  state.held = context_.mode.held;
  state.homed = axis.position.isHomed();
  if (owner != nullptr) state.homing = owner->homingPhase();
  state.position_valid = axis.position.isValid();
  state.microsteps = axis.motor.microsteps();
  state.speed_override = context_.mode.speed_override;
  state.fault = axis.faultText();
  state.remedy = axis.remedyText();
  state.stopped_by = axis.stopped_by;
  state.endstops_met = axis.endstops_met;
  state.stops = axis.stops;
  shown.holds = axis.holds;
  state.position_note = axis.position.note();
  state.drivers = axis.motor.driverStates();
  shown.steps_per_unit = axis.stepsPerUnit();
  shown.origin = axis.position.origin();
  shown.backlash = axis.backlash();
  shown.motors = axis.motor.lines().motors();
  shown.square_lags = axis.motor.squareLags();
  shown.limits = axis.limitsOfNextPlan();
  for (const motor::Motion& motion : axis.motor.motions().all()) {
    AxisSnapshot::Motion view;
    view.serial = motion.serial;
    view.planned = motion.planned;
    view.slows_down = motion.slows_down;
    if (motion.target) view.target = axis.positionOf(static_cast<double>(*motion.target));
    shown.motions.push_back(std::move(view));
  }
  if (const auto* motion = owner != nullptr ? owner->motion() : nullptr) {
    const Goal* goal = motion->goalOf(axis);
    if (motion->isHeld() && goal != nullptr && goal->target) {
      shown.held_target = axis.positionOf(static_cast<double>(*goal->target));
    }
    if (goal != nullptr && motion->sharedPath() && motion->motionAlong()) {
      shown.path = {goal->move, motion->sharedPath(), motion->motionAlong(), motion->slowsDown()};
    }
  }
  shown.ended_path = axis.ended_path;
  shown.path_axis = axis.pathAxis();
  shown.commanded = axis.positionOf(axis.restCount()) + axis.position.remainder();
  if (!axis.moving()) shown.rest = restOf(axis.pathStart(0));
  shown.channel = axis.motor.state();
  shown.memory = axis.memory();
  return shown;
}

std::shared_ptr<const MachineSnapshot> Controller::snapshot() const {
  auto snapshot = std::make_shared<MachineSnapshot>();
  snapshot->stops_handled = context_.stops_handled;
  snapshot->stops_concluded = stops_concluded_;
  snapshot->io = io_;
  for (const auto& axis : context_.axes) snapshot->axes.push_back(snapshotOf(*axis));
  return snapshot;
}

}  // namespace stepdriver::machine
