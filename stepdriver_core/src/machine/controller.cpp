#include "controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "activity/driver_activities.h"
#include "activity/follow_goal.h"
#include "activity/homing.h"
#include "activity/point_motion.h"
#include "activity/steps.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "point_to_point/setpoint_stream.h"
#include "profile/errors.h"
#include "profile/resting_count.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::machine {
namespace {

using activity::Activity;
using activity::EarlyEnd;
using activity::Goal;
using activity::Order;

const EarlyEnd kStopped{axis::MoveEnd::kStopped, "it was stopped"};
constexpr const char* kMovedMeanwhile = "it moved while its path was planned";
const EarlyEnd kTakenOver{axis::MoveEnd::kReplaced, "another command took over"};

constexpr const char* kChipRemedy =
    "let it cool down, check the motor's wiring and the current that is set, then call recover";
constexpr const char* kPositionRemedy =
    "check what blocks the motor, and its encoder, then call recover, and home it or set its "
    "position";
constexpr const char* kPowerRemedy =
    "check the relay, its supply and fuse, and the wiring of the feedback, then call recover";
constexpr const char* kLateRemedy =
    "lower the axis's speed or the machine's load (stepdriver_check says what it can sustain), "
    "call "
    "recover, and home it or set its position";

/// For a line whose axes may still have to come to rest, for any direction.
void refuseTooFast(const std::vector<const axis::AxisModel*>& axes, double velocity) {
  double linear = 0.0;
  double rotary = 0.0;
  for (const axis::AxisModel* axis : axes) {
    double& sum = axis->config.kind == config::Kind::kLinear ? linear : rotary;
    sum += axis->maxSpeed() * axis->maxSpeed();
  }
  const double most = std::sqrt(std::max(linear, rotary));
  if (velocity <= most * (1.0 + 1e-12)) return;
  axes.front()->refuse(fmt::format(
      "the velocity {0} {2} of the line is above {1} {2}, the highest that its axes reach together",
      numberText(velocity), upperBoundText(most), linear >= rotary ? "m/s" : "rad/s"));
}

// [microsteps] Where the joint of an axis at rest is.
double restOf(const axis::PathStart& start) { return start.motor.position.value() - start.slack; }

void refuseBadNumber(const axis::AxisModel& axis, const char* what, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  axis.refuse(
      fmt::format("the {} of the line is {}, but must be a finite number above 0, or 0 for as fast "
                  "as the limits allow",
                  what, numberText(value)));
}

/// Why the drivers of an axis can't be switched by a pin that isn't wired.
std::string whyNoPin(const config::AxisConfig& axis,
                     std::optional<bool> driver::DriverChip::*active_level, const char* pin,
                     const char* name) {
  for (std::size_t i = 0; i < axis.motors(); ++i) {
    const driver::DriverChip& chip = axis.motorAt(i).driver;
    if (!(chip.*active_level)) return fmt::format("the {} has no {} pin", chip.title, name);
  }
  return fmt::format("pins/{} isn't configured", pin);
}

// A velocity of a stream; 0 if it is lower than any that can be configured: it would make no step
// in a quarter of an hour, and might take longer to a soft limit than a motion can.
double velocityOrRest(const axis::AxisModel& axis, double velocity) {
  return std::abs(velocity) * axis.stepsPerUnit() < config::kLowestRate ? 0.0 : velocity;
}

}  // namespace

Controller::Controller(const std::vector<config::AxisConfig>& axes,
                       const std::vector<motor::MotorLines>& lines, axis::LineNames names,
                       const std::optional<pulse::Signal>& emergency_stop,
                       EmergencyDisable emergency_disable, activity::MotorPower motor_power)
    : context_(names.inputs.size()),
      activities_(context_),
      emergency_stop_(emergency_stop),
      emergency_disable_(emergency_disable) {
  context_.out = &last_;
  context_.lines = std::move(names);
  context_.motor_power = std::move(motor_power);
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
}

std::vector<axis::AxisModel*> Controller::withSharers(AxisId id) {
  std::vector<axis::AxisModel*> axes{&axis(id)};
  axes.insert(axes.end(), axis(id).sharers().begin(), axis(id).sharers().end());
  return axes;
}

Controller::~Controller() { context_.out = &last_; }

void Controller::handle(const Input& input, activity::Outputs& out) {
  context_.now = input.now;
  context_.slipped = input.slipped;
  context_.stops_asked = input.stops_asked;
  context_.beginTurn(out);
  std::visit([this](const auto& what) { on(what); }, input.what);
  activities_.poll();
  supervise();
  while (supervisePower()) {
  }
  context_.pin_done.reset();
  for (const auto& axis : context_.axes) axis->rememberRest();
  if (!awaiting_rest_.empty()) {
    const bool rests = std::none_of(context_.axes.begin(), context_.axes.end(),
                                    [](const auto& axis) { return axis->moving(); });
    if (rests) awaiting_rest_.clear();
  }
  context_.endTurn();
  context_.beginTurn(last_);
}

pulse::Nanoseconds Controller::due() const {
  pulse::Nanoseconds due = std::min(activities_.due(), context_.motor_power.due());
  for (const auto& axis : context_.axes) due = std::min(due, idleDue(*axis));
  return due;
}

// ---- the engine ----

void Controller::on(const EngineNews& news) {
  handleStops(news);
  for (std::size_t i = 0; i < news.channels.size(); ++i) update(axis(i), news.channels[i]);
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
    const Activity* const owner = activities_.owner(axis);
    const bool homes = owner != nullptr && owner->homingPhase() != axis::HomingPhase::kNone;
    if ((at_max || state.end == pulse::EndReason::kEndstopMin) && !homes) axis.noteEndstop(at_max);
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
  const auto has = [&failure](const auto& axis) {
    const motor::MotorLines& all = axis->motor.lines();
    for (std::size_t i = 0; i < all.motors(); ++i) {
      const motor::ChipLines& own = all.motorAt(i);
      const bool has_it =
          failure.input ? own.endstop_min == failure.line || own.endstop_max == failure.line ||
                              own.fault == failure.line || own.in_position == failure.line
                        : own.step == failure.line || own.dir == failure.line;
      if (has_it) return true;
    }
    return false;
  };
  const auto owner = std::find_if(context_.axes.begin(), context_.axes.end(), has);
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
      disable(*axis, {axis::MoveEnd::kEmergencyStop, axis->fault.what()}, nullptr);
    }
    // The outputs of a chip at fault are off, and a motor that was stopped at speed may have
    // stalled.
    if (axis->fault && axis->motor.brake().isReleased() && activities_.isFree(*axis)) {
      activities_.begin(std::make_unique<activity::EngageBrake>(context_, *axis, nullptr),
                        kTakenOver);
    }
    superviseIdle(*axis);
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

// ---- requests ----

void Controller::on(const Requested& requested) {
  const SharedCall call = std::make_shared<activity::PendingCall>(context_, requested.call);
  try {
    std::visit([this, &call](const auto& wanted) { serve(wanted, call); }, requested.request);
  } catch (const Error& error) {
    call->fail(activity::failureOf(error));
  }
}

void Controller::refuseUnlessSharersAreFree(const axis::AxisModel& axis,
                                            const std::string& what) const {
  for (const axis::AxisModel* sharer : axis.sharers()) {
    const Activity* const owner = activities_.owner(*sharer);
    const bool busy = sharer->moving() || (owner != nullptr && !owner->isInBackground()) ||
                      activities_.heir(*sharer) != nullptr;
    if (busy) {
      axis.refuse("busy: " + sharer->name() + ", which shares its motors, is at work; " + what +
                  " when both are at rest");
    }
  }
}

void Controller::refuseUnlessFree(const axis::AxisModel& axis, const std::string& what) const {
  axis.refuseUnlessOpen();
  refuseUnlessSharersAreFree(axis, what);
  const Activity* owner = activities_.owner(axis);
  if (owner != nullptr && owner->homingPhase() != axis::HomingPhase::kNone) {
    axis.refuse("busy: it is being homed; " + what + " at rest");
  }
  if (axis.moving()) axis.refuse("busy: it moves; " + what + " at rest");
  for (const Activity* busy : {owner, static_cast<const Activity*>(activities_.heir(axis))}) {
    if (busy == nullptr || busy->isInBackground()) continue;
    const bool pins =
        busy->work() == Activity::Work::kWritesPins || busy->work() == Activity::Work::kDisables;
    if (!pins) axis.refuseWhileHeld();  // held motions must continue from here
    axis.refuse(pins ? "busy: its driver's pins are being written; " + what + " when that is done"
                     : "busy: it is about to move; " + what + " at rest");
  }
}

void Controller::refuseUnlessReadyToMove(const axis::AxisModel& axis) const {
  axis.refuseUnlessReady();
  for (const Activity* busy : {activities_.owner(axis), activities_.heir(axis)}) {
    if (busy == nullptr || busy->isInBackground() || busy->canHandOver()) continue;
    if (busy->work() == Activity::Work::kDisables) axis.refuse("disabled; enable it first");
    if (busy->work() != Activity::Work::kMoves) {
      axis.refuse("busy: its driver's pins are being written");
    }
  }
  activities_.refuseWhileSharersAreBusy(axis);
  axis.refuseWhileHeld();
}

Goal Controller::goalWithOutcome(Goal goal) {
  goal.move = context_.newMove();
  goal.outcome = std::make_shared<axis::Outcome<axis::MoveResult>>();
  return goal;
}

// ---- motions ----

double Controller::relativeOrigin(const axis::AxisModel& axis) const {
  const Activity* owner = activities_.owner(axis);
  const activity::MotionExecution* motion = owner != nullptr ? owner->motion() : nullptr;
  const motor::Motion* latest = axis.motor.motions().latest();
  if (motion == nullptr || latest == nullptr) {
    return axis.restCount() + axis.position.remainder() * axis.stepsPerUnit();
  }
  const Goal* goal = motion->goalOf(axis);
  // A motion that slows down or takes up backlash ends at the end of its motor's motion.
  if (latest->slows_down || (goal != nullptr && goal->of_motor)) {
    return axis.jointAt(latest->planned.plan()->endPosition().value());
  }
  if (goal == nullptr || !goal->target) {
    axis.refuse("busy: it jogs without an end; give an absolute position");
  }
  return static_cast<double>(*goal->target) + goal->remainder;
}

void Controller::setTarget(Goal& goal, axis::AxisModel& axis, double position, bool relative) {
  refuseUnlessReadyToMove(axis);
  if (!relative) axis.refuseUnlessHomed();
  axis.refuseUnlessFinite("position", position);
  const double count =
      relative ? relativeOrigin(axis) + position * axis.stepsPerUnit() : axis.countOf(position);
  axis.refuseBeyondLimits(relative ? axis.positionOf(count) : position, "the position");
  goal.target = motion::restingCount(count);
  goal.remainder = count - static_cast<double>(*goal.target);
}

Goal Controller::goalOf(const MoveTo& wanted) {
  axis::AxisModel& moved = axis(wanted.axis);
  Goal goal;
  double position = wanted.position;
  if (wanted.shortest) {
    if (wanted.relative) moved.refuse("shortest: the position is relative, but must be absolute");
    if (!moved.config.continuous) {
      moved.refuse("shortest: the axis doesn't turn without end, see continuous in its parameters");
    }
    position += moved.pathAxis().turnsTowards(moved.positionOf(moved.jointCount()), position);
  }
  setTarget(goal, moved, position, wanted.relative);
  goal.velocity = moved.checkedVelocity(wanted.velocity);
  if (!moved.moving()) moved.refuseIntoEndstop(*goal.target - moved.jointCount());
  return goal;
}

void Controller::serve(const MoveTo& wanted, const SharedCall& call) {
  axis::AxisModel& moved = axis(wanted.axis);
  const Goal goal = goalWithOutcome(goalOf(wanted));
  activities_.begin(std::make_unique<activity::FollowGoal>(
                        context_, std::vector<Order>{{&moved, goal}}, activity::JoinPath(), call),
                    kTakenOver);
}

void Controller::serve(const MoveRounds& wanted, const SharedCall& call) {
  const axis::AxisModel& moved = axis(wanted.axis);
  if (moved.config.kinematics) {
    moved.refuse("it shares its motors, none of which turns for it alone: move it by a distance");
  }
  if (moved.config.steps_per_round <= 0.0) {
    moved.refuse(
        "the steps per revolution are not known: configure steps_per_round or "
        "full_steps_per_round");
  }
  if (!std::isfinite(wanted.rounds)) {
    moved.refuse(fmt::format("rounds is {}, but must be a finite number", wanted.rounds));
  }
  const double way = wanted.rounds * moved.config.steps_per_round / moved.config.steps_per_unit;
  serve(MoveTo{wanted.axis, way, true, wanted.velocity}, call);
}

void Controller::serve(const PlanMove& wanted, const SharedCall& call) {
  axis::AxisModel& moved = axis(wanted.move.axis);
  const Goal goal = goalOf(wanted.move);
  axis::MovePlan shown;
  const motion::PlannedMotion planned = [&] {
    try {
      motion::Plan plan = activity::planGoal(moved, goal, context_.motionNow(),
                                             activity::earliestStart(context_, moved, 0))
                              .plan;
      motion::PlannedMotion motion = moved.motor.shaped(std::move(plan.profile));
      shown.move = activity::moveOf(moved, goal, motion.made(), plan.overshoot);
      return motion;
    } catch (const motion::TooLong& error) {
      moved.refuse(error.what());
    }
  }();
  shown.steps_per_unit = moved.stepsPerUnit();
  const double unit = 1.0 / moved.stepsPerUnit();
  for (const motion::Piece& piece : planned.plan()->pieces()) {
    shown.pieces.push_back({piece.duration.value(), moved.positionOf(piece.p0.value()),
                            piece.v0 * unit, piece.a * unit, piece.j * unit});
  }
  if (const motion::InputShaper* shaper = planned.made().shaper()) {
    for (const motion::Impulse& impulse : shaper->impulses()) {
      shown.parts.push_back({impulse.part, static_cast<double>(impulse.delay_ns) * 1e-9});
    }
  }
  call->succeed(std::move(shown));
}

const Goal* Controller::streamedGoal(const axis::AxisModel& axis) const {
  const Activity* owner = activities_.owner(axis);
  const activity::MotionExecution* motion = owner != nullptr ? owner->motion() : nullptr;
  const Goal* current = motion != nullptr && axis.moving() ? motion->goalOf(axis) : nullptr;
  return current != nullptr && current->isStreamed() ? current : nullptr;
}

void Controller::limitVelocity(Goal& goal, const axis::AxisModel& axis, const char* moves) const {
  const bool up = goal.velocity > 0.0;
  const auto& limit = up ? axis.config.max_position : axis.config.min_position;
  if (limit) {
    const double count = axis.countOf(*limit);
    goal.target = motion::restingCount(count);
    // An axis that shares motors has no counts of its own to rest on.
    if (!axis.sharers().empty()) goal.remainder = count - static_cast<double>(*goal.target);
  }
  if (axis.moving()) return;
  const std::int64_t sign = up ? 1 : -1;
  if (goal.target && (*goal.target - axis.jointCount()) * sign <= 0) {
    axis.refuse(fmt::format("it stands at the soft limit {}; it {} only away from it",
                            axis.pathAxis().showLimit(*limit, up ? axis.config.max_position_source
                                                                 : axis.config.min_position_source),
                            moves));
  }
  axis.refuseIntoEndstop(sign);
}

Controller::MayBegin Controller::goalOf(const Jog& wanted, const SharedCall& call) {
  axis::AxisModel& moved = axis(wanted.axis);
  moved.refuseUnlessFinite("velocity", wanted.velocity, "/s");
  const double velocity = velocityOrRest(moved, wanted.velocity);
  const Goal* current = streamedGoal(moved);
  const bool jogs = current != nullptr && current->kind == Goal::Kind::kJog;
  if (velocity == 0.0) {
    const bool waits = !moved.moving();
    for (Activity* at : {activities_.heir(moved), activities_.owner(moved)}) {
      if (at != nullptr && at->isStreamed() && (jogs || waits)) {
        at->end({axis::MoveEnd::kStopped, "the jog ended"}, call);
      }
    }
    return std::nullopt;
  }
  if (moved.stops != wanted.unless_stopped_since.value_or(moved.stops)) {
    moved.refuse("the jog was stopped; let it pause or send 0 before it begins again");
  }
  refuseUnlessReadyToMove(moved);
  moved.refuseTooFast(std::abs(velocity));
  Goal goal;
  goal.kind = Goal::Kind::kJog;
  goal.velocity = velocity;
  limitVelocity(goal, moved, "jogs");
  if (jogs && !activities_.owner(moved)->motion()->slowsDown() && current->velocity == velocity) {
    return std::nullopt;  // it does that already
  }
  return goalWithOutcome(goal);
}

Controller::MayBegin Controller::positionGoal(const Setpoint& wanted, double timeout) {
  // Without a setpoint the axis returns to the last one after a period, but not sooner than this:
  // messages come irregularly.
  constexpr std::int64_t kLeastPatience = 10'000'000;
  axis::AxisModel& moved = axis(wanted.axis);
  moved.refuseUnlessHomed();
  double position = wanted.value;
  if (moved.config.max_position) position = std::min(position, *moved.config.max_position);
  if (moved.config.min_position) position = std::max(position, *moved.config.min_position);
  moved.refuseBeyondLimits(position, "the position");
  const std::int64_t now = context_.motionNow();
  Goal goal;
  goal.kind = Goal::Kind::kSetpoint;
  goal.velocity = moved.maxSpeed();
  activity::Setpoint& setpoint = goal.setpoint;
  setpoint.of_position = true;
  setpoint.position = moved.countOf(position);
  goal.target = motion::restingCount(setpoint.position);
  goal.remainder = setpoint.position - static_cast<double>(*goal.target);
  const axis::SetpointStream::Course course =
      moved.setpoints.add(setpoint.position, now, nanoseconds(timeout), moved.stops);
  setpoint.velocity = course.velocity;
  setpoint.period = static_cast<double>(course.period_ns) * 1e-9;
  setpoint.reach_ns = course.came_ns + course.period_ns;
  setpoint.return_ns = setpoint.reach_ns + std::max(course.period_ns, kLeastPatience);
  setpoint.until_ns = now + nanoseconds(timeout);
  if (!moved.moving()) {
    const std::int64_t way = *goal.target - moved.jointCount();
    if (way == 0) return std::nullopt;
    moved.refuseIntoEndstop(way);
  }
  return goal;
}

Controller::MayBegin Controller::velocityGoal(const Setpoint& wanted, double timeout) {
  axis::AxisModel& moved = axis(wanted.axis);
  moved.refuseTooFast(std::abs(wanted.value));
  const double velocity = velocityOrRest(moved, wanted.value);
  // As with a jog, 0 leaves other motions alone.
  const Goal* current = streamedGoal(moved);
  const bool follows = current != nullptr && current->kind == Goal::Kind::kSetpoint;
  if (velocity == 0.0 && !follows) return std::nullopt;
  Goal goal;
  goal.kind = Goal::Kind::kSetpoint;
  goal.velocity = velocity;
  goal.setpoint.until_ns = context_.motionNow() + nanoseconds(timeout);
  if (velocity != 0.0) limitVelocity(goal, moved, "moves");
  return goal;
}

template <typename Message, typename GoalOf>
void Controller::beginStreamed(const std::vector<Message>& messages, const SharedCall& call,
                               const GoalOf& goal_of) {
  const std::vector<SharedCall> calls = activity::PartedCall::divide(call, messages.size());
  std::vector<activity::StartTogether::Start> starts;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    try {
      const MayBegin goal = goal_of(messages[i], calls[i]);
      if (goal) starts.push_back({{&axis(messages[i].axis), *goal}, calls[i]});
    } catch (const Error& error) {
      calls[i]->fail(activity::failureOf(error));
    }
  }
  beginTogether(std::move(starts));
}

// Axes that move need not wait for others that are at rest and must be woken first.
void Controller::beginTogether(std::vector<activity::StartTogether::Start> starts) {
  using Start = activity::StartTogether::Start;
  const auto moves = [this](const Start& start) {
    const Activity* owner = activities_.owner(*start.order.axis);
    return start.order.axis->moving() && owner != nullptr && owner->canHandOver();
  };
  const bool any_waits = std::any_of(starts.begin(), starts.end(), [this](const Start& start) {
    const Activity* owner = activities_.owner(*start.order.axis);
    return start.order.axis->mustWake() || (owner != nullptr && !owner->canHandOver());
  });
  const auto first_waiting =
      any_waits ? std::stable_partition(starts.begin(), starts.end(), moves) : starts.end();
  const auto begin = [this](std::vector<Start> group) {
    if (group.empty()) return;
    std::vector<SharedCall> calls;
    calls.reserve(group.size());
    for (const Start& start : group) calls.push_back(start.call);
    try {
      activities_.begin(std::make_unique<activity::StartTogether>(context_, std::move(group)),
                        kTakenOver);
    } catch (const Error& error) {
      for (const SharedCall& call : calls) call->fail(activity::failureOf(error));
    }
  };
  begin({starts.begin(), first_waiting});
  begin({first_waiting, starts.end()});
}

void Controller::serve(const Jog& wanted, const SharedCall& call) {
  const MayBegin goal = goalOf(wanted, call);
  if (!goal) return;
  activities_.begin(
      std::make_unique<activity::FollowGoal>(
          context_, std::vector<Order>{{&axis(wanted.axis), *goal}}, activity::JoinPath(), call),
      kTakenOver);
}

void Controller::serve(const JogTogether& wanted, const SharedCall& call) {
  beginStreamed(wanted.jogs, call,
                [this](const Jog& jog, const SharedCall& part) { return goalOf(jog, part); });
}

void Controller::serve(const FollowSetpoints& wanted, const SharedCall& call) {
  beginStreamed(wanted.setpoints, call, [&](const Setpoint& setpoint, const SharedCall& /*part*/) {
    axis::AxisModel& moved = axis(setpoint.axis);
    const bool is_position = wanted.mode == SetpointMode::kPosition;
    moved.refuseUnlessFinite("setpoint", setpoint.value, is_position ? "" : "/s");
    if (moved.stops != setpoint.unless_stopped_since.value_or(moved.stops)) {
      moved.refuse(is_position
                       ? "the setpoints were stopped; let them pause before they begin again"
                       : "the setpoints were stopped; let them pause or send 0 before they begin "
                         "again");
    }
    refuseUnlessReadyToMove(moved);
    return is_position ? positionGoal(setpoint, wanted.timeout)
                       : velocityGoal(setpoint, wanted.timeout);
  });
}

void Controller::serve(const MoveLine& wanted, const SharedCall& call) {
  const axis::AxisModel& first = axis(wanted.axes.front());
  refuseBadNumber(first, "velocity", wanted.velocity);
  refuseBadNumber(first, "duration", wanted.duration);
  if (wanted.velocity > 0.0 && wanted.duration > 0.0) {
    first.refuse(
        fmt::format("the line has a velocity, {}, and a duration, {} s; give only one of them",
                    numberText(wanted.velocity), numberText(wanted.duration)));
  }
  std::vector<const axis::AxisModel*> moved_axes;
  for (const AxisId id : wanted.axes) moved_axes.push_back(&axis(id));
  refuseTooFast(moved_axes, wanted.velocity);
  std::vector<Order> orders;
  for (std::size_t i = 0; i < wanted.axes.size(); ++i) {
    axis::AxisModel& moved = axis(wanted.axes[i]);
    Goal goal;
    goal.kind = Goal::Kind::kTogether;
    setTarget(goal, moved, wanted.positions[i], wanted.relative);
    orders.push_back({&moved, goalWithOutcome(goal)});
  }
  activities_.begin(std::make_unique<activity::FollowLine>(context_, std::move(orders),
                                                           wanted.velocity, wanted.duration, call),
                    {axis::MoveEnd::kStopped, "a line was to begin"});
}

void Controller::serve(const FollowTrajectory& wanted, const SharedCall& call) {
  std::vector<axis::AxisModel*> axes;
  for (std::size_t i = 0; i < wanted.axes.size(); ++i) {
    axis::AxisModel& moved = axis(wanted.axes[i]);
    refuseUnlessReadyToMove(moved);
    moved.refuseUnlessHomed();
    if (moved.stops != wanted.stops[i]) moved.refuse("it was stopped while this was prepared");
    if (!wanted.prepared) activity::refuseIfStopped(context_, moved);
    axes.push_back(&moved);
  }
  if (!wanted.prepared) {
    return call->fail(
        {activity::Failure::Kind::kOutdated, axes.front()->name() + ": not prepared"});
  }
  std::vector<Order> orders;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Goal goal;
    goal.kind = Goal::Kind::kTogether;
    const double target = wanted.path ? wanted.path->targets[i] : wanted.prepared->target(i);
    goal.target = motion::restingCount(target);
    goal.remainder = target - static_cast<double>(*goal.target);
    goal.path_limits = wanted.prepared->axes()[i].limits;
    orders.push_back({axes[i], goalWithOutcome(goal)});
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i]->pathAxis() != wanted.prepared->axes()[i]) {
      return call->fail({activity::Failure::Kind::kOutdated,
                         axes[i]->name() + ": its limits or its scale changed meanwhile"});
    }
    if (wanted.path &&
        (axes[i]->moving() || restOf(axes[i]->pathStart(0)) != wanted.path->from[i])) {
      return call->fail(
          {activity::Failure::Kind::kOutdated, axes[i]->name() + ": " + kMovedMeanwhile});
    }
  }
  const auto join = [prepared = wanted.prepared, axes,
                     path = wanted.path](const std::vector<axis::PathStart>& starts) {
    for (std::size_t i = 0; path && i < starts.size(); ++i) {
      if (starts[i].moves || restOf(starts[i]) != path->from[i]) axes[i]->refuse(kMovedMeanwhile);
    }
    auto joined = axis::PreparedTrajectory::join(prepared, starts);
    if (!path || !path->window) return joined;
    return std::shared_ptr<const axis::SharedPath>(
        std::make_shared<const QueuedPath>(std::move(joined), path->window, true));
  };
  if (wanted.begins_ns > 0) {
    std::vector<axis::PathAxis> facts = wanted.prepared->axes();
    return call->succeed(
        activities_.beginLater({std::move(orders), join, std::move(facts), wanted.begins_ns}));
  }
  const auto join_at = [join, axes](std::int64_t at) { return join(activity::startsOf(axes, at)); };
  activities_.begin(
      std::make_unique<activity::FollowGoal>(context_, std::move(orders), join_at, call),
      kTakenOver);
}

const Goal* Controller::goalOf(const axis::AxisModel& axis) const {
  const Activity* owner = activities_.owner(axis);
  const activity::MotionExecution* motion = owner != nullptr ? owner->motion() : nullptr;
  return motion != nullptr ? motion->goalOf(axis) : nullptr;
}

void Controller::serve(const ExtendPath& wanted, const SharedCall& call) {
  axis::AxisModel& extended = axis(wanted.axis);
  Activity* owner = activities_.owner(extended);
  const Goal* goal = goalOf(extended);
  if (goal == nullptr || goal->move != wanted.move) {
    extended.refuse("the path doesn't continue: " +
                    axis::howItEnded(extended.ended_path.get(), wanted.move));
  }
  owner->extend(wanted.extension, call);
}

// ---- stops ----

void Controller::serve(const StopAxis& wanted, const SharedCall& call) {
  axis(wanted.axis).noteStop();
  activities_.end(axis(wanted.axis), kStopped, call);
}

void Controller::serve(const StopMove& wanted, const SharedCall& call) {
  axis::AxisModel& stopped = axis(wanted.axis);
  if (activities_.schedule().dropMove(stopped, wanted.move, kStopped)) return;
  const Goal* goal = goalOf(stopped);
  if (goal == nullptr || goal->move != wanted.move) return;
  stopped.noteStop();
  activities_.end(stopped, kStopped, call);
}

void Controller::serve(const StopAll& /*wanted*/, const SharedCall& call) {
  context_.mode.held = false;
  for (const auto& axis : context_.axes) axis->noteStop();
  activities_.endAll(kStopped, call);
}

void Controller::serve(const Hold& /*wanted*/, const SharedCall& call) {
  if (!context_.mode.closed.empty()) throw Refused(context_.mode.closed);
  if (context_.mode.held) return;
  context_.mode.held = true;
  activities_.schedule().dropAll({axis::MoveEnd::kStopped, "the machine was put on hold"});
  for (const auto& axis : context_.axes) ++axis->stops;
  activities_.forEach([&](Activity& activity) {
    if (activity.hasBegun()) activity.hold(call);
  });
}

void Controller::serve(const Resume& /*wanted*/, const SharedCall& call) {
  if (!context_.mode.held) return;
  // All or none: what is refused for one axis leaves the machine on hold.
  activities_.forEach([](const Activity& activity) {
    if (activity.hasBegun()) activity.refuseUnlessResumable();
  });
  context_.mode.held = false;
  for (const auto& axis : context_.axes) ++axis->stops;
  activities_.forEach([&](Activity& activity) {
    if (activity.hasBegun()) activity.resume(call);
  });
}

void Controller::serve(const SetSpeedOverride& wanted, const SharedCall& call) {
  context_.mode.speed_override = wanted.factor;
  activities_.forEach([&](Activity& activity) { activity.speedChanged(call); });
}

void Controller::serve(const SetLimits& wanted, const SharedCall& call) {
  axis::AxisModel& changed = axis(wanted.axis);
  changed.refuseUnlessOpen();
  changed.changeLimits(changed.checkedLimits(wanted.limits));
  Activity* owner = activities_.owner(changed);
  // Axes that move together keep their limits.
  if (owner != nullptr && owner->axes().size() == 1) owner->speedChanged(call);
}

void Controller::refuseWhileEmergencyStopInput() const {
  if (!emergency_stop_) return;
  const int level = context_.levels.level(emergency_stop_->line);
  const std::string input =
      "the emergency stop input " + context_.lines.input(emergency_stop_->line);
  if (level < 0) throw Refused(input + " can't be read: " + gpio::errorText(-level));
  if ((level != 0) == emergency_stop_->active) throw Refused(input + " is active; release it");
}

void Controller::serve(const Recover& /*wanted*/, const SharedCall& call) {
  refuseWhileEmergencyStopInput();
  if (context_.stops_asked != context_.stops_handled) {
    throw Refused("an emergency stop has come meanwhile");
  }
  context_.stops_cleared = context_.stops_handled;
  context_.out->clear_stops = context_.stops_handled;
  for (const auto& faulty : context_.axes) {
    if (!faulty->fault) continue;
    ++faulty->stops;
    activities_.begin(std::make_unique<activity::Recover>(context_, *faulty, call),
                      {axis::MoveEnd::kFault, faulty->fault.what()});
  }
}

// ---- homing ----

void Controller::serve(const Home& wanted, const SharedCall& call) {
  for (const AxisId id : wanted.axes) {
    activity::Homing::refuseUnlessReady(axis(id));
    refuseUnlessReadyToMove(axis(id));
    refuseUnlessFree(axis(id), "it is homed");
  }
  if (wanted.only_check) return;
  for (const AxisId id : wanted.axes) {
    for (const AxisId other : wanted.axes) {
      const auto& sharers = axis(id).sharers();
      if (std::find(sharers.begin(), sharers.end(), &axis(other)) == sharers.end()) continue;
      axis(id).refuse("it shares its motors with " + axis(other).name() +
                      ": home them one after the other");
    }
  }
  activity::AcceptedHoming accepted;
  for (const AxisId id : wanted.axes) {
    const auto outcome = std::make_shared<activity::Homing::Result>();
    accepted.ids.push_back(++homings_);
    accepted.outcomes.push_back(outcome);
    activities_.begin(std::make_unique<activity::Homing>(context_, axis(id), homings_, outcome),
                      kTakenOver);
  }
  call->succeed(std::move(accepted));
}

void Controller::serve(const CancelHoming& wanted, const SharedCall& /*call*/) {
  activities_.forEach([&](Activity& activity) { activity.cancelHomings(wanted.ids); });
}

// ---- the driver chip ----

void Controller::serve(const Enable& wanted, const SharedCall& call) {
  std::vector<axis::AxisModel*> all;
  for (const AxisId id : wanted.axes) {
    for (axis::AxisModel* axis : withSharers(id)) {
      if (std::find(all.begin(), all.end(), axis) == all.end()) all.push_back(axis);
    }
  }
  for (const axis::AxisModel* changed : all) {
    changed->refuseUnlessOpen();
    if (!changed->motor.pins().hasEnable()) {
      changed->refuse(
          "pins/enable isn't configured: the motor is energized as long as the chip is");
    }
  }
  if (!wanted.on) {
    for (axis::AxisModel* changed : all) {
      disable(*changed, {axis::MoveEnd::kStopped, "it was disabled"}, call);
    }
    return;
  }
  std::vector<axis::AxisModel*> to_enable;
  for (axis::AxisModel* changed : all) {
    if (mustEnable(*changed)) to_enable.push_back(changed);
  }
  for (axis::AxisModel* changed : to_enable) {
    ++changed->stops;
    activities_.begin(std::make_unique<activity::Enable>(context_, *changed, call), kTakenOver);
  }
}

bool Controller::mustEnable(const axis::AxisModel& axis) const {
  activity::refuseUnlessCurrentStays(context_, axis);
  for (const Activity* busy : {activities_.owner(axis), activities_.heir(axis)}) {
    if (busy != nullptr && busy->work() == Activity::Work::kDisables) {
      axis.refuse("busy: it is being disabled");
    }
  }
  const motor::Power& power = axis.motor.power();
  const Activity* owner = activities_.owner(axis);
  const bool is_awake = power.wantsEnabled() && !axis.mustWake();
  if (is_awake && (owner == nullptr || !owner->isInBackground())) return false;
  if (!power.wantsEnabled()) refuseUnlessFree(axis, "it is enabled");
  return true;
}

void Controller::disable(axis::AxisModel& axis, const EarlyEnd& why, const SharedCall& call) {
  ++axis.stops;
  for (Activity* at : {activities_.owner(axis), activities_.heir(axis)}) {
    if (at != nullptr && at->joinDisable(call)) return;
  }
  activities_.begin(std::make_unique<activity::Disable>(context_, axis, call), why);
}

void Controller::serve(const Sleep& wanted, const SharedCall& call) {
  const std::vector<axis::AxisModel*> all = withSharers(wanted.axis);
  for (const axis::AxisModel* changed : all) {
    refuseUnlessFree(*changed, wanted.asleep ? "it is put to sleep" : "it is woken");
    if (!changed->motor.pins().hasSleep()) {
      changed->refuse(
          whyNoPin(changed->config, &driver::DriverChip::sleep_asleep, "sleep", "SLEEP"));
    }
  }
  for (axis::AxisModel* changed : all) {
    ++changed->stops;
    activities_.begin(std::make_unique<activity::Sleep>(context_, *changed, wanted.asleep, call),
                      kTakenOver);
  }
}

void Controller::serve(const Reset& wanted, const SharedCall& call) {
  const std::vector<axis::AxisModel*> all = withSharers(wanted.axis);
  for (const axis::AxisModel* changed : all) {
    refuseUnlessFree(*changed, "it is reset");
    if (!changed->motor.pins().hasReset()) {
      changed->refuse(whyNoPin(changed->config, &driver::DriverChip::reset_held, "reset", "RESET"));
    }
  }
  for (axis::AxisModel* changed : all) {
    activities_.begin(std::make_unique<activity::Reset>(context_, *changed, call), kTakenOver);
  }
}

void Controller::serve(const SetMicrosteps& wanted, const SharedCall& call) {
  axis::AxisModel& changed = axis(wanted.axis);
  changed.refuseMicrosteps(wanted.microsteps);
  refuseUnlessFree(changed, "its microsteps are changed");
  if (changed.fault) changed.refuse("at fault: " + changed.fault.what() + "; call recover first");
  if (wanted.microsteps == changed.motor.microsteps()) return;
  const std::int64_t count = changed.motor.state().count;
  const std::int64_t common = changed.motor.translator().nearestCommon(count, wanted.microsteps);
  if (common != count) {
    const double place = changed.positionOf(changed.jointAt(static_cast<double>(common)));
    if (!changed.config.align_on_microstep_change) {
      changed.refuse(fmt::format(
          "1/{} has no position at {}; the nearest that both modes have is {}: move "
          "there first, or configure align_on_microstep_change",
          wanted.microsteps, changed.showPlace(changed.positionNow()), changed.showPlace(place)));
    }
    refuseUnlessReadyToMove(changed);
    changed.refuseBeyondLimits(place, "the common position");
    changed.refuseIntoEndstop(common - count);
  }
  activities_.begin(
      std::make_unique<activity::ChangeMicrosteps>(context_, changed, wanted.microsteps, call),
      kTakenOver);
}

void Controller::serve(const SetPosition& wanted, const SharedCall& /*call*/) {
  axis::AxisModel& changed = axis(wanted.axis);
  refuseUnlessFree(changed, "its position is set");
  changed.refuseUnlessFinite("position", wanted.position);
  changed.refuseBeyondLimits(wanted.position, "the position");
  changed.position.declare(wanted.position - changed.exactCount() / changed.stepsPerUnit());
}

// ---- beginning and end ----

void Controller::serve(const BringUp& /*wanted*/, const SharedCall& call) {
  for (const auto& axis : context_.axes) {
    activities_.begin(std::make_unique<activity::BringUp>(context_, *axis, call), kTakenOver);
  }
}

void Controller::serve(const RestorePosition& wanted, const SharedCall& call) {
  axis::AxisModel& restored = axis(wanted.axis);
  const axis::AxisMemory& kept = wanted.memory;
  const std::string why = restored.whyImpossible(kept, wanted.source);
  if (!why.empty()) {
    restored.position.setNote(why);
    return;
  }
  std::string doubt = restored.whyUnverified(kept, wanted.clean, wanted.source);
  activities_.begin(
      std::make_unique<activity::RestorePosition>(context_, restored, kept, std::move(doubt), call),
      kTakenOver);
}

void Controller::serve(const NotePosition& wanted, const SharedCall& /*call*/) {
  axis(wanted.axis).position.setNote(wanted.why);
}

void Controller::serve(const Close& wanted, const SharedCall& call) {
  context_.mode.closed = wanted.reason;
  context_.mode.held = false;
  for (const auto& axis : context_.axes) ++axis->stops;
  activities_.endAll({axis::MoveEnd::kStopped, wanted.reason}, call);
}

void Controller::serve(const AwaitRest& /*wanted*/, const SharedCall& call) {
  awaiting_rest_.push_back(call);
}

void Controller::serve(const PowerDown& /*wanted*/, const SharedCall& call) {
  const EarlyEnd why{axis::MoveEnd::kStopped, context_.mode.closed};
  for (const auto& axis : context_.axes) {
    if (axis->motor.pins().hasEnable() && axis->config.disable_on_shutdown) {
      disable(*axis, why, call);
    } else if (axis->motor.brake().isWired()) {
      activities_.begin(std::make_unique<activity::EngageBrake>(context_, *axis, call), why);
    }
  }
  context_.motor_power.switchOff(context_.now, call);
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
  state.position_note = axis.position.note();
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
  for (const auto& axis : context_.axes) snapshot->axes.push_back(snapshotOf(*axis));
  return snapshot;
}

}  // namespace stepdriver::machine
