#include "motion_execution.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "message_text.h"
#include "point_motion.h"
#include "profile/errors.h"
#include "profile/resting_count.h"
#include "stepdriver_core/error.h"

namespace stepdriver::activity {
namespace {

constexpr pulse::Nanoseconds kLongestLead = 2'000'000'000;

/// [s] Wall-clock time from the beginning of a goal to a motion time.
double durationOf(const Context& context, const Goal& goal, std::int64_t end_ns) {
  const std::int64_t slid = context.slipped - goal.slipped_ns;
  return std::max(0.0, static_cast<double>(end_ns - goal.began_ns + slid) / 1e9);
}

bool isAt(const axis::AxisModel& axis, const Goal& goal) {
  if (goal.waits_at_target) return false;
  if (!axis.sharers().empty() && goal.target) {
    constexpr double kRounding = 1e-6;
    return std::abs(goal.end(axis) - axis.exactCount()) <= axis.reach() + kRounding;
  }
  return goal.target == (goal.of_motor ? axis.motor.state().count : axis.jointCount());
}

/// Why the last motion of an axis was ended by a fault or an emergency stop. That is latched by the
/// axis or by one that shares its motors; a recover may have cleared it meanwhile.
std::string faultThatEnded(const axis::AxisModel& axis) {
  std::string fault = axis.faultText();
  if (!fault.empty()) return fault;
  switch (axis.motor.state().end) {
    case pulse::EndReason::kChipFault:
      return "a driver chip reported a fault";
    case pulse::EndReason::kNotInPosition:
      return "it wasn't in position in time";
    case pulse::EndReason::kTooLate:
      return "a pulse was too late";
    case pulse::EndReason::kLineError:
      return "a line failed";
    default:
      return axis::Fault::kEmergencyStop;
  }
}

/// How the goal of an axis at rest ended, also in words.
/// @param slowed_down its last motion was to end before it. @param left_by why
std::pair<axis::MoveEnd, std::string> endOf(const axis::AxisModel& axis, const Goal& goal,
                                            bool slowed_down, const EarlyEnd& left_by) {
  switch (axis.motor.state().end) {
    case pulse::EndReason::kDone:
      if (!slowed_down && isAt(axis, goal)) return {axis::MoveEnd::kReached, ""};
      if (!left_by.text.empty()) return {left_by.end, left_by.text};
      return {left_by.end, "its motion ended before its target"};
    case pulse::EndReason::kEndstopMin:
      return {axis::MoveEnd::kEndstopMin, axis.metText(false)};
    case pulse::EndReason::kEndstopMax:
      return {axis::MoveEnd::kEndstopMax, axis.metText(true)};
    case pulse::EndReason::kEmergencyStop:
      return {axis::MoveEnd::kEmergencyStop, faultThatEnded(axis)};
    case pulse::EndReason::kChipFault:
    case pulse::EndReason::kNotInPosition:
    case pulse::EndReason::kTooLate:
    case pulse::EndReason::kLineError:
      return {axis::MoveEnd::kFault, faultThatEnded(axis)};
    case pulse::EndReason::kSkewed:
      return {axis::MoveEnd::kStopped, "its motors got too far apart"};
    case pulse::EndReason::kBlocked:
      return {axis::MoveEnd::kStopped, "its motor was blocked"};
    case pulse::EndReason::kCompanion:
      break;
  }
  return {axis::MoveEnd::kCompanion, "an axis that it moved together with was stopped"};
}

void addMarks(const Goal& goal, axis::MoveResult& result) {
  if (!goal.marks) return;
  result.marks_made = goal.marks->made();
  result.marks_not_made = goal.marks->notMade();
  result.message += goal.marks->text();
}

// What its position would have switched on the rest of the way.
void addLeftOut(const Context& context, const axis::AxisModel& axis, double target,
                axis::MoveResult& result) {
  for (const auto& left : context.motion_outputs.leftOut(axis, axis.exactCount(), target)) {
    result.marks_not_made += left.places;
    result.message += fmt::format("; {} wasn't switched at {} places that weren't reached",
                                  left.output, left.places);
  }
}

axis::MoveResult resultWith(const Context& context, const axis::AxisModel& axis, const Goal& goal,
                            axis::MoveEnd end, const std::string& why) {
  axis::MoveResult result;
  result.end = end;
  result.position = axis.positionNow();
  result.duration = durationOf(context, goal, axis.motor.state().end_time);
  result.message = end == axis::MoveEnd::kReached
                       ? fmt::format("{} reached {}", axis.name(), axis.showPlace(result.position))
                       : standsAt(axis, goal, why) + axis.abruptText();
  addMarks(goal, result);
  if (end != axis::MoveEnd::kReached && goal.target) {
    addLeftOut(context, axis, static_cast<double>(*goal.target), result);
  }
  return result;
}

void reportEnd(axis::AxisModel& axis, const Goal& goal, axis::MoveResult result) {
  // It may have come to rest alone, after another axis had left the path.
  const bool along_path = goal.kind == Goal::Kind::kTogether || goal.path_limits.acceleration > 0.0;
  if (along_path) {
    axis.ended_path =
        std::make_shared<const motion::EndedPath>(motion::EndedPath{goal.move, result.message});
  }
  if (goal.outcome) goal.outcome->set(std::move(result));
}

/// For a goal that no other goal has replaced: the axis is at rest.
void conclude(axis::AxisModel& axis, const Goal& goal, axis::MoveResult result) {
  const bool reached = result.end == axis::MoveEnd::kReached;
  axis.position.reached(reached ? (goal.remainder - goal.between(axis)) / axis.stepsPerUnit()
                                : 0.0);
  reportEnd(axis, goal, std::move(result));
}

// Motors that square stop at their own endstops.
void refuseIntoEndstop(const Order& order) {
  if (order.goal.motors.square) return;
  order.axis->refuseIntoEndstop(stepsTo(*order.axis, order.goal));
}

Failure neverBegun(const Predecessor& left) {
  return {Failure::Kind::kRefused,
          left.axis->name() + ": another command took over before it began"};
}

}  // namespace

Failure failureOf(const std::exception& error) {
  if (dynamic_cast<const Refused*>(&error) != nullptr) {
    return {Failure::Kind::kRefused, error.what()};
  }
  if (dynamic_cast<const GpioError*>(&error) != nullptr) {
    return {Failure::Kind::kGpio, error.what()};
  }
  return {Failure::Kind::kOther, error.what()};
}

std::string standsAt(const axis::AxisModel& axis, const Goal& goal, const std::string& why) {
  const std::string place = axis.showPlace(axis.positionNow());
  std::string not_at;
  if (goal.target) {
    const std::string target = axis.showPlace(axis.positionOf(static_cast<double>(*goal.target)));
    if (target != place) not_at = ", not at " + target;
  }
  return fmt::format("{} stands at {}{}: {}", axis.name(), place, not_at, why);
}

MotionExecution::MotionExecution(Context& context, std::vector<Order> orders, JoinPath join,
                                 std::shared_ptr<const CommonStart> start, std::int64_t begins_ns)
    : context_(context),
      orders_(std::move(orders)),
      join_(std::move(join)),
      start_(std::move(start)),
      begins_ns_(begins_ns),
      group_(join_ ? context.newGroup() : 0),
      lead_(kLead) {
  for (const Order& order : orders_) {
    if (!join_) break;
    course_.targets.push_back(static_cast<double>(*order.goal.target) + order.goal.remainder);
  }
}

// ---- plans ----

std::shared_ptr<const motion::Profile> MotionExecution::planPath(std::int64_t at) {
  const double factor = context_.mode.speed_override;
  const auto shared = [](motion::Profile profile) {
    return std::make_shared<const motion::Profile>(std::move(profile));
  };
  if (path_ == nullptr) {
    follow({join_(at), course_.targets});
    return shared(course_.path->plan(at, course_.path->begin(), factor));
  }
  const motion::SharedPath& along = *course_.path;
  if (!anyMoves()) return shared(along.plan(at, along.restart(path_->endPosition()), factor));
  const motion::MotionState from = path_->stateAt(at);
  return shared(slowsDown() ? along.planStop(at, from) : along.plan(at, from, factor));
}

void MotionExecution::follow(Course course) {
  course_ = std::move(course);
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    Goal& goal = orders_[i].goal;
    goal.target = motion::restingCount(course_.targets[i]);
    goal.remainder = course_.targets[i] - static_cast<double>(*goal.target);
    goal.waits_at_target = course_.path->waitsAtEnd();
  }
}

MotionExecution::Plans MotionExecution::plan(pulse::Nanoseconds lead) {
  Plans plans;
  // Axes that never joined a path come to rest one by one.
  const bool alone = !join_ || (slowsDown() && path_ == nullptr);
  for (const Order& order : orders_) {
    if (alone && slowsDown() && !order.axis->moving()) continue;
    plans.at = std::max(plans.at, earliestStart(context_, *order.axis, lead));
  }
  if (beginsTogether()) {
    for (const axis::AxisModel* axis : start_->axes) {
      plans.at = std::max(plans.at, earliestStart(context_, *axis, lead));
    }
  }
  if (!started_ && !slowsDown()) plans.at = std::max(plans.at, begins_ns_);
  try {
    if (!alone) {
      plans.path = planPath(plans.at);
      if (mustWaitForOutputs(plans)) plans.path = planPath(plans.at);
      for (std::size_t i = 0; i < orders_.size(); ++i) {
        const motor::Motor& motor = orders_[i].axis->motor;
        plans.planned.push_back({motor.shaped(course_.path->profileOf(i, *plans.path)), 0.0,
                                 orders_[i].goal.path_limits, plans.at});
      }
      return plans;
    }
    if (!slowsDown()) {
      const Order& order = orders_.front();
      GoalPlan own = planGoal(*order.axis, order.goal, context_.motionNow(), plans.at);
      plans.planned.push_back({order.axis->motor.shaped(std::move(own.plan.profile)),
                               own.plan.overshoot, own.limits, own.slows_ns});
      return plans;
    }
    for (const Order& order : orders_) {
      Planned& planned = plans.planned.emplace_back();
      if (!order.axis->moving()) continue;
      planned.motion = order.axis->motor.shaped(planStop(*order.axis, plans.at));
      planned.limits = order.axis->motor.motions().latest()->limits;
      planned.slows_ns = plans.at;
    }
  } catch (const motion::TooLong& error) {
    orders_.front().axis->refuse(error.what());
  }
  return plans;
}

std::vector<axis::Move> MotionExecution::prepare() {
  prepared_ = plan(lead_);
  if (course_.path && course_.path->marks()) {
    context_.motion_outputs.refuseUnlessFree(*course_.path->marks(), group_, axesAlong());
  }
  std::vector<axis::Move> moves;
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    const Planned& planned = prepared_->planned[i];
    const Goal& goal = orders_[i].goal;
    axis::Move move =
        moveOf(*orders_[i].axis, goal, planned.motion->made(), planned.overshoot, orders_);
    move.id = goal.move;
    move.outcome = goal.outcome;
    moves.push_back(std::move(move));
  }
  return moves;
}

// ---- outputs along its path ----

std::vector<const axis::AxisModel*> MotionExecution::axesAlong() const {
  std::vector<const axis::AxisModel*> axes;
  axes.reserve(orders_.size());
  for (const Order& order : orders_) axes.push_back(order.axis);
  return axes;
}

// @throw Refused if one of them isn't free.
void MotionExecution::takeOutputs(const motion::SharedPath& path) {
  const auto wanted = path.marks();
  if (!wanted) return;
  if (!marks_) {
    marks_ = std::make_shared<MarksOfPath>();
    marks_->group = group_;
  }
  context_.motion_outputs.take(*wanted, marks_, axesAlong());
  for (Order& order : orders_) order.goal.marks = marks_;
}

// The first marks can't come before the least times of their outputs are over: then it begins
// later.
bool MotionExecution::mustWaitForOutputs(Plans& plans) const {
  if (started_ || slowsDown() || !course_.path->marks()) return false;
  const std::int64_t earliest =
      context_.motion_outputs.mayBegin(*course_.path->marks()) - context_.slipped;
  if (earliest <= plans.at) return false;
  plans.at = earliest;
  return true;
}

void MotionExecution::orderMarks(const Plans& plans,
                                 const std::shared_ptr<std::vector<pulse::Follow>>& follows) {
  if (!marks_ || plans.path == nullptr) return;
  const auto along = course_.path->marks();
  if (!along) return;
  std::vector<motion::ShapedAxis> axes;
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    axes.push_back({*plans.planned[i].motion, 1.0 / orders_[i].axis->stepsPerUnit()});
  }
  auto shaped = std::make_shared<const motion::ShapedAxes>(std::move(axes), plans.at);
  if (shaped->longestDelayNs() == 0) shaped.reset();
  context_.motion_outputs.order(group_, plans.path, along, shaped, context_.marksOf(follows));
}

// ---- orders to the engine ----

void MotionExecution::order(Plans plans, const SharedCall& extension) {
  OpenOrder open;
  open.mode = mode_;
  open.course = course_;
  open.extension = extension;
  open.follows = context_.newCommand(beginsTogether() ? start_->number : 0);
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    if (!plans.planned[i].motion) {
      open.serials.push_back(0);
      continue;
    }
    axis::AxisModel& axis = *orders_[i].axis;
    const motor::Motion* before = axis.motor.motions().latest();
    open.serials.push_back(axis.motor.nextSerial());
    pulse::Follow& follow = open.follows->emplace_back();
    follow.channel = axis.motor.channel();
    follow.serial = open.serials[i];
    follow.profile = plans.planned[i].motion->made();
    follow.continues = before != nullptr ? before->serial : 0;
    follow.restart_interval = axis.restartInterval();
    follow.full_step = orders_[i].goal.measures ? 0 : axis.motor.microsteps();
    follow.group = plans.path != nullptr ? group_ : 0;
    follow.stops = context_.stops_handled;
    follow.faults = axis.motor.state().faults();
    follow.slows = slowsDown();
    follow.arrives = !slowsDown() && orders_[i].goal.hasTarget();
    follow.settles = mode_ == Mode::kRun;
    follow.still = orders_[i].goal.motors.still;
    follow.squares = orders_[i].goal.motors.square;
    follow.is_square = orders_[i].goal.motors.are_square;
    follow.until_block = orders_[i].goal.until_block;
  }
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    Order& order = orders_[i];
    if (!plans.planned[i].motion) continue;
    if (!started_ && !slowsDown()) order.goal.began_ns = plans.at;
    motor::Motion motion;
    motion.serial = open.serials[i];
    motion.limits = plans.planned[i].limits;
    motion.slows_ns = plans.planned[i].slows_ns;
    motion.overshoot = plans.planned[i].overshoot;
    motion.planned = *plans.planned[i].motion;
    motion.order = open.follows;
    if (order.goal.kind != Goal::Kind::kSetpoint || order.goal.setpoint.of_position) {
      motion.target = order.goal.target;
    }
    motion.slows_down = mode_ == Mode::kStop;
    order.axis->motor.ordered(std::move(motion));
  }
  orderMarks(plans, open.follows);
  path_ = plans.path;
  open.plans = std::move(plans);
  open_.push_back(std::move(open));
}

void MotionExecution::begin(std::vector<Predecessor> predecessors, SharedCall call) {
  predecessors_ = std::move(predecessors);
  call_ = std::move(call);
  if (course_.path) takeOutputs(*course_.path);
  order(*std::exchange(prepared_, std::nullopt));
}

void MotionExecution::beginStop(std::vector<Predecessor> predecessors, const EarlyEnd& why) {
  predecessors_ = std::move(predecessors);
  started_ = true;
  stop(why);
  poll();
}

bool MotionExecution::anyMoves() const {
  return std::any_of(orders_.begin(), orders_.end(),
                     [](const Order& order) { return order.axis->moving(); });
}

void MotionExecution::change(Mode mode, const SharedCall& call) {
  mode_ = mode;
  if (call) calls_.push_back(call);
  if (!anyMoves() && (!held_ || awaits_)) return calls_.clear();
  try {
    order(plan(lead_));
  } catch (const std::exception& error) {
    if (held_) return fail(failureOf(error));
    if (call) call->fail(failureOf(error));
    calls_.clear();
  }
}

void MotionExecution::stop(const EarlyEnd& why, const SharedCall& call) {
  if (over_) return;
  if (mode_ == Mode::kStop) {
    if (call && !open_.empty()) calls_.push_back(call);
    return;
  }
  why_ = why;
  if (marks_) context_.motion_outputs.stop(context_, group_);
  if (anyMoves()) return change(Mode::kStop, call);
  if (isParked()) drop();  // otherwise it has come to rest by itself
}

// Gives up the goals that it kept at rest.
void MotionExecution::drop() {
  for (const Order& order : orders_) {
    activity::conclude(*order.axis, order.goal, droppedResult(order, &order == &orders_.front()));
  }
  result_ = droppedResult(orders_.front(), true);
  finish();
}

void MotionExecution::hold(const SharedCall& call) {
  if (over_ || mode_ != Mode::kRun) return;
  if (orders_.front().goal.isStreamed()) return stop(kEndedByHold, call);
  if (awaits_ && !anyMoves()) held_ = true;
  change(Mode::kHold, call);
}

void MotionExecution::refuseUnlessResumable() const {
  if (over_ || mode_ != Mode::kHold || anyMoves()) return;
  for (const Order& order : orders_) {
    order.axis->refuseUnlessReady();
    refuseIntoEndstop(order);
  }
}

void MotionExecution::resume(const SharedCall& call) {
  if (over_ || mode_ != Mode::kHold) return;
  // A path that awaits its continuation orders nothing now.
  from_rest_ = !anyMoves() && !awaits_;
  change(Mode::kRun, call);
  held_ = false;
}

void MotionExecution::replan(const SharedCall& call) {
  if (over_ || mode_ != Mode::kRun || !anyMoves()) return;
  change(Mode::kRun, call);
}

// ---- a longer path ----

namespace {

Failure outdated(const axis::AxisModel& axis) {
  return {Failure::Kind::kOutdated, axis.name() + ": its path has changed meanwhile"};
}

}  // namespace

void MotionExecution::extend(Extension extension, const SharedCall& call) {
  const axis::AxisModel& axis = *orders_.front().axis;
  if (over_ || mode_ == Mode::kStop) return call->fail(noContinuation());
  if (extension_ || course_.path != extension.of) return call->fail(outdated(axis));
  extension_.emplace(std::move(extension), call);
  if (open_.empty()) tryExtension();
}

// Why its path can't be continued.
Failure MotionExecution::noContinuation() const {
  const axis::AxisModel& axis = *orders_.front().axis;
  return {
      Failure::Kind::kRefused,
      axis.name() + ": the path doesn't continue: " +
          (why_.text.empty() ? motion::howItEnded(axis.ended_path.get(), orders_.front().goal.move)
                             : why_.text)};
}

bool MotionExecution::mayExtend(const Extension& extension) const {
  const auto precedes = [](motion::DoubleDouble earlier, motion::DoubleDouble later) {
    constexpr double kRounding = 1e-9;
    return (later - earlier).hi > -kRounding;
  };
  if (course_.path != extension.of || context_.hasUnknownStop()) return false;
  if (!precedes(extension.same_from, path_->stateAt(context_.motionNow()).position)) return false;
  if (!extension.moves_on) return true;
  if (mode_ == Mode::kRun && anyMoves()) return true;  // orderExtension() knows when it takes over
  return (mode_ == Mode::kHold || awaits_) && precedes(path_->endPosition(), extension.same_until);
}

// The engine has handled all orders.
void MotionExecution::tryExtension() {
  const auto [extension, call] = *std::exchange(extension_, std::nullopt);
  if (!mayExtend(extension)) return call->fail(outdated(*orders_.front().axis));
  try {
    takeOutputs(*extension.path);
  } catch (const Error& error) {
    return call->fail(failureOf(error));
  }
  if (extension.moves_on && mode_ == Mode::kRun) return orderExtension(extension, call);
  follow({extension.path, extension.targets});
  accepted_course_ = course_;
  if (extension.moves_on) {
    awaits_ = false;
  } else if (awaits_ && !course_.path->waitsAtEnd()) {
    awaits_ = false;
    if (!held_) rested();
  }
}

void MotionExecution::orderExtension(const Extension& extension, const SharedCall& call) {
  const bool from_rest = !anyMoves();
  const auto revert = [this, call = call](Failure failure) {
    follow(accepted_course_);
    call->fail(std::move(failure));
  };
  follow({extension.path, extension.targets});
  try {
    if (from_rest) {
      for (const Order& order : orders_) {
        order.axis->refuseUnlessReady();
        refuseIntoEndstop(order);
      }
    }
    Plans plans = plan(lead_);
    if (!from_rest && extension.same_until < path_->stateAt(plans.at).position) {
      return revert(outdated(*orders_.front().axis));
    }
    from_rest_ = from_rest;
    order(std::move(plans), call);
  } catch (const std::exception& error) {
    revert(failureOf(error));
  }
}

// ---- news from the engine ----

bool MotionExecution::isDone() const {
  return std::all_of(orders_.begin(), orders_.end(), [](const Order& order) {
    return order.axis->motor.state().end == pulse::EndReason::kDone;
  });
}

// Also while the engine has not handled what was ordered with it.
bool MotionExecution::isOpen() const {
  if (open_.empty()) return false;
  const std::vector<pulse::Follow>& follows = *open_.back().follows;
  return std::any_of(follows.begin(), follows.end(), [this](const pulse::Follow& follow) {
    const motor::Motor& motor = context_.axes[static_cast<std::size_t>(follow.channel)]->motor;
    return motor.state().taken < follow.serial;
  });
}

bool MotionExecution::poll() {
  if (over_) return true;
  if (isOpen()) return false;
  if (!open_.empty()) {
    // Orders after a refused order are refused too.
    const std::vector<OpenOrder> orders = std::exchange(open_, {});
    for (const OpenOrder& order : orders) {
      if (wasAccepted(order)) {
        accept(order);
      } else if (order.extension) {
        order.extension->fail(outdated(*orders_.front().axis));
      }
    }
    if (wasAccepted(orders.back())) {
      calls_.clear();
    } else {
      refused();
    }
  }
  if (!over_ && open_.empty() && extension_) tryExtension();
  const bool rests = !over_ && open_.empty() && !anyMoves() && !isParked();
  if (rests && !(marks_ && context_.motion_outputs.isDue(group_))) rested();
  return over_;
}

// The engine accepts an order for all of its axes or for no axis.
bool MotionExecution::wasAccepted(const OpenOrder& order) const {
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    const std::uint64_t serial = order.serials[i];
    if (serial != 0) return serial <= orders_[i].axis->motor.state().accepted;
  }
  return false;
}

void MotionExecution::accept(const OpenOrder& order) {
  lead_ = kLead;
  if (!started_) {
    for (Order& own : orders_) own.goal.slipped_ns = context_.slipped;
  }
  started_ = true;
  from_rest_ = false;
  awaits_ = false;
  accepted_mode_ = order.mode;
  accepted_path_ = order.plans.path;
  accepted_course_ = order.course;
  for (const Predecessor& before : std::exchange(predecessors_, {})) {
    for (std::size_t i = 0; i < orders_.size(); ++i) {
      if (orders_[i].axis != before.axis || !order.plans.planned[i].motion) continue;
      reportEnd(*before.axis, before.goal,
                replacedResult(before, orders_[i], *order.plans.planned[i].motion->plan()));
    }
  }
  call_.reset();
}

void MotionExecution::refused() {
  path_ = accepted_path_;
  if (accepted_course_.path && course_.path != accepted_course_.path) follow(accepted_course_);
  for (auto before = predecessors_.begin(); before != predecessors_.end();) {
    // This was planned from the other's order: if that was refused, this one never began.
    if (before->call && before->axis->motor.state().accepted < before->serial) {
      before->call->fail(neverBegun(*before));
      before->call.reset();
    }
    const bool ended = !before->axis->moving();
    if (ended) conclude(context_, *before);
    before = ended ? predecessors_.erase(before) : before + 1;
  }
  // It still waits for the continuation of its path.
  if (awaits_ && !anyMoves()) {
    if (mode_ == Mode::kHold) held_ = true;
    if (mode_ == Mode::kStop) drop();
    return calls_.clear();
  }
  // The motion to change has ended by itself.
  if (started_ && !anyMoves()) {
    // A resume during the deceleration of a hold came too late: it continues from rest.
    if (mode_ == Mode::kRun && accepted_mode_ == Mode::kHold && isDone()) from_rest_ = true;
    if (!from_rest_) return calls_.clear();
    if (mode_ == Mode::kHold) held_ = true;
    if (mode_ == Mode::kStop) drop();
    if (slowsDown()) return calls_.clear();
  }
  // An emergency stop has come; its news will arrive soon, and end this.
  if (context_.hasUnknownStop()) return;
  tryAgain();
}

void MotionExecution::tryAgain() {
  if (lead_ > kLongestLead) {
    return fail(
        {Failure::Kind::kRefused,
         fmt::format(
             "{}: the pulse thread doesn't keep up: it took a plan later than {} after it was made",
             orders_.front().axis->name(), millisecondsText(lead_))});
  }
  lead_ *= 2;
  try {
    if (!started_ && mode_ != Mode::kRun) {
      const std::string why =
          mode_ == Mode::kHold ? "a hold came before its motion began" : why_.text;
      throw Refused(orders_.front().axis->name() + ": " + why);
    }
    if (!slowsDown()) {
      for (const Order& order : orders_) {
        order.axis->refuseUnlessReady();
        if (!order.axis->moving()) refuseIntoEndstop(order);
      }
    }
    order(plan(lead_));
  } catch (const std::exception& error) {
    fail(failureOf(error));
  }
}

// It can't continue as planned. Axes that still move come to rest.
void MotionExecution::fail(Failure failure) {
  const bool is_resume = started_ && from_rest_;
  if (call_) call_->fail(failure);
  call_.reset();
  for (const SharedCall& call : std::exchange(calls_, {})) {
    if (anyMoves() || is_resume) call->fail(failure);
  }
  why_ = {axis::MoveEnd::kStopped, failure.text};
  if (!started_) failure_ = std::move(failure);
  if (is_resume) return drop();
  if (!anyMoves()) return finish();
  started_ = true;
  mode_ = Mode::kStop;
  lead_ = kLead;
  try {
    order(plan(lead_));
  } catch (const std::exception&) {
    // The motion that the engine follows comes to rest by itself.
    mode_ = Mode::kRun;
  }
}

void MotionExecution::rested() {
  if (!started_) {
    // An emergency stop or a fault has come before it began.
    if (why_.text.empty()) return;
    return fail({Failure::Kind::kRefused, orders_.front().axis->name() + ": " + why_.text});
  }
  // An emergency stop has come before it continued, and will say so.
  if (from_rest_ && why_.text.empty()) return;
  if (accepted_mode_ == Mode::kHold && mode_ == Mode::kHold && isDone()) {
    held_ = true;
    return calls_.clear();
  }
  if (endsInWait()) {
    awaits_ = true;
    held_ = mode_ == Mode::kHold;
    return calls_.clear();
  }
  concludeGoals();
  finish();
}

// A stop that came too late to change anything ends it nevertheless.
bool MotionExecution::endsInWait() const {
  return course_.path && course_.path->waitsAtEnd() && accepted_mode_ == Mode::kRun &&
         mode_ != Mode::kStop && isDone();
}

void MotionExecution::concludeGoals() {
  for (const Order& order : orders_) {
    const axis::MoveResult result = resultOf(order);
    if (&order == &orders_.front()) result_ = result;
    activity::conclude(*order.axis, order.goal, result);
  }
}

void MotionExecution::concludePredecessors() {
  for (const Predecessor& before : std::exchange(predecessors_, {})) {
    conclude(context_, before);
  }
}

void MotionExecution::finish() {
  concludePredecessors();
  if (marks_) {
    const bool reached = why_.text.empty() && result_.end == axis::MoveEnd::kReached;
    context_.motion_outputs.leave(context_, group_, reached);
  }
  over_ = true;
  held_ = false;
  awaits_ = false;
  if (extension_) extension_->second->fail(noContinuation());
  extension_.reset();
  call_.reset();
  calls_.clear();
}

std::vector<Predecessor> MotionExecution::handOver() {
  if (marks_) context_.motion_outputs.leave(context_, group_, false);
  std::vector<Predecessor> left = std::exchange(predecessors_, {});
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    const Order& order = orders_[i];
    Predecessor& before = left.emplace_back();
    before.axis = order.axis;
    before.goal = order.goal;
    before.left_by = why_.text.empty() ? "another command took over" : why_.text;
    before.call = call_;
    if (!open_.empty()) before.serial = open_.front().serials[i];
    before.orders.push_back({0, accepted_mode_ != Mode::kRun});
    for (const OpenOrder& open : open_) {
      if (open.serials[i] == 0) continue;
      before.orders.push_back({open.serials[i], open.mode != Mode::kRun});
    }
  }
  const Failure replaced{
      Failure::Kind::kRefused,
      orders_.front().axis->name() + ": the path doesn't continue: another command took over"};
  if (extension_) extension_->second->fail(replaced);
  extension_.reset();
  for (const OpenOrder& open : open_) {
    if (open.extension) open.extension->fail(replaced);
  }
  open_.clear();
  over_ = true;
  call_.reset();
  calls_.clear();
  return left;
}

const Goal* MotionExecution::goalOf(const axis::AxisModel& axis) const {
  for (const Order& order : orders_) {
    if (order.axis == &axis) return &order.goal;
  }
  return nullptr;
}

// ---- how it ended, in words ----

void MotionExecution::conclude(const Context& context, const Predecessor& ended) {
  // Neither it nor its successor has begun.
  if (ended.call) ended.call->fail(neverBegun(ended));
  const auto last = std::find_if(ended.orders.rbegin(), ended.orders.rend(),
                                 [&ended](const Predecessor::Followed& order) {
                                   return order.serial <= ended.axis->motor.state().accepted;
                                 });
  const auto [end, why] =
      endOf(*ended.axis, ended.goal, last->slows_down, {axis::MoveEnd::kStopped, ended.left_by});
  activity::conclude(*ended.axis, ended.goal,
                     resultWith(context, *ended.axis, ended.goal, end, why));
}

axis::MoveResult MotionExecution::resultOf(const Order& order) const {
  const bool by_fault =
      why_.end == axis::MoveEnd::kFault || why_.end == axis::MoveEnd::kEmergencyStop;
  auto [end, why] = endOf(*order.axis, order.goal, accepted_mode_ != Mode::kRun,
                          {by_fault ? why_.end : axis::MoveEnd::kStopped, why_.text});
  if (end == axis::MoveEnd::kCompanion) why = endedWith(*order.axis);
  // It is where it was to go, but an output couldn't be written.
  const axis::Fault& fault = order.axis->fault;
  const auto& marks = order.goal.marks;
  if (end == axis::MoveEnd::kReached && marks && marks->notMade() != 0 && fault) {
    end = fault.isEmergencyStop() ? axis::MoveEnd::kEmergencyStop : axis::MoveEnd::kFault;
    why = fault.what();
  }
  return resultWith(context_, *order.axis, order.goal, end, why);
}

std::string MotionExecution::endedWith(const axis::AxisModel& axis) const {
  for (const Order& other : orders_) {
    const pulse::EndReason end = other.axis->motor.state().end;
    if (other.axis != &axis && end != pulse::EndReason::kDone &&
        end != pulse::EndReason::kCompanion) {
      return fmt::format("it moved together with {}, which was stopped: {}", other.axis->name(),
                         endOf(*other.axis, other.goal, false, why_).second);
    }
  }
  return "an axis that it moved together with was stopped";
}

// For a goal that was held at rest.
axis::MoveResult MotionExecution::droppedResult(const Order& order, bool by_it) const {
  if (by_it || orders_.size() == 1) {
    return resultWith(context_, *order.axis, order.goal, why_.end, why_.text);
  }
  return resultWith(
      context_, *order.axis, order.goal, axis::MoveEnd::kCompanion,
      fmt::format("it was held together with {}: {}", orders_.front().axis->name(), why_.text));
}

axis::MoveResult MotionExecution::replacedResult(const Predecessor& before, const Order& by,
                                                 const motion::Profile& profile) const {
  const axis::AxisModel& axis = *before.axis;
  axis::MoveResult result;
  result.end = axis::MoveEnd::kReplaced;
  result.position = axis.positionNow();
  result.duration = durationOf(context_, before.goal, profile.startNs());
  std::string what;
  if (by.goal.kind == Goal::Kind::kJog) {
    what = "a jog";
  } else if (by.goal.kind == Goal::Kind::kSetpoint) {
    what = "a setpoint";
  } else if (by.goal.kind == Goal::Kind::kTogether) {
    what = "a motion together with other axes";
  } else {
    what = "a move to " + axis.showPlace(axis.positionOf(static_cast<double>(*by.goal.target)));
  }
  result.message = fmt::format("{} was at {} when {} took over", axis.name(),
                               axis.showPlace(result.position), what);
  addMarks(before.goal, result);
  return result;
}

}  // namespace stepdriver::activity
