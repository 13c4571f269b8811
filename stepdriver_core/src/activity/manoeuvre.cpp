#include "manoeuvre.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "message_text.h"
#include "point_motion.h"
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
  if (!axis.sharers().empty() && goal.target) {
    constexpr double kRounding = 1e-6;
    return std::abs(static_cast<double>(*goal.target) - axis.exactCount()) <=
           axis.reach() + kRounding;
  }
  return goal.target == (goal.of_motor ? axis.motor.state().count : axis.jointCount());
}

/// How the goal of an axis at rest ended, also in words.
/// @param slowed_down its last motion was to end before it. @param left_by why
std::pair<axis::MoveEnd, std::string> endOf(const axis::AxisModel& axis, const Goal& goal,
                                            bool slowed_down, const Why& left_by) {
  switch (axis.motor.state().end) {
    case pulse::EndReason::kDone:
      if (slowed_down || !isAt(axis, goal)) return {left_by.end, left_by.text};
      return {axis::MoveEnd::kReached, ""};
    case pulse::EndReason::kEndstopMin:
      return {axis::MoveEnd::kEndstopMin, "the min endstop was met"};
    case pulse::EndReason::kEndstopMax:
      return {axis::MoveEnd::kEndstopMax, "the max endstop was met"};
    case pulse::EndReason::kEmergencyStop:
      return {axis::MoveEnd::kEmergencyStop, axis.fault.what()};
    case pulse::EndReason::kChipFault:
    case pulse::EndReason::kNotInPosition:
    case pulse::EndReason::kTooLate:
    case pulse::EndReason::kLineError:
      return {axis::MoveEnd::kFault, axis.fault.what()};
    case pulse::EndReason::kSkewed:
      return {axis::MoveEnd::kStopped, "its motors got too far apart"};
    case pulse::EndReason::kCompanion:
      break;
  }
  return {axis::MoveEnd::kCompanion, "an axis that it moved together with was stopped"};
}

axis::MoveResult resultWith(const Context& context, const axis::AxisModel& axis, const Goal& goal,
                            axis::MoveEnd end, const std::string& why) {
  const pulse::ChannelState& state = axis.motor.state();
  axis::MoveResult result;
  result.end = end;
  result.position = axis.positionNow();
  result.duration = durationOf(context, goal, state.end_time);
  if (end == axis::MoveEnd::kReached) {
    result.message = fmt::format("{} reached {}", axis.name(), axis.showPlace(result.position));
    return result;
  }
  result.message = standsAt(axis, goal, why);
  if (!axis.position.isValid() && state.end_abrupt) {
    result.message += "; it stopped too fast for the position to be trusted";
  }
  return result;
}

void tell(const Goal& goal, axis::MoveResult result) {
  if (goal.outcome) goal.outcome->set(std::move(result));
}

/// For a goal that no other goal has replaced: the axis is at rest.
void conclude(axis::AxisModel& axis, const Goal& goal, axis::MoveResult result) {
  const bool reached = result.end == axis::MoveEnd::kReached;
  axis.position.reached(reached ? goal.remainder / axis.stepsPerUnit() : 0.0);
  tell(goal, std::move(result));
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
  const std::string not_at =
      goal.target ? ", not at " + axis.showPlace(axis.positionOf(static_cast<double>(*goal.target)))
                  : "";
  return fmt::format("{} stands at {}{}: {}", axis.name(), axis.showPlace(axis.positionNow()),
                     not_at, why);
}

Manoeuvre::Manoeuvre(Context& context, std::vector<Order> orders, JoinPath join,
                     std::shared_ptr<const CommonStart> start)
    : context_(context),
      orders_(std::move(orders)),
      join_(std::move(join)),
      start_(std::move(start)),
      group_(join_ ? context.newGroup() : 0),
      lead_(kLead) {}

// ---- plans ----

std::shared_ptr<const motion::Profile> Manoeuvre::planPath(std::int64_t at) {
  const double factor = context_.mode.speed_override;
  const auto shared = [](motion::Profile profile) {
    return std::make_shared<const motion::Profile>(std::move(profile));
  };
  if (path_ == nullptr) {
    shared_path_ = join_(at);
    return shared(shared_path_->plan(at, shared_path_->begin(), factor));
  }
  const axis::SharedPath& along = *shared_path_;
  if (!anyMoves()) return shared(along.plan(at, {path_->endPosition(), 0.0, 0.0}, factor));
  const motion::MotionState from = path_->stateAt(at);
  return shared(slowsDown() ? along.planStop(at, from) : along.plan(at, from, factor));
}

Manoeuvre::Plans Manoeuvre::plan(pulse::Nanoseconds lead) {
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
  try {
    if (!alone) {
      plans.path = planPath(plans.at);
      for (std::size_t i = 0; i < orders_.size(); ++i) {
        const motor::Motor& motor = orders_[i].axis->motor;
        plans.planned.push_back({motor.shaped(shared_path_->profileOf(i, *plans.path)), 0.0,
                                 orders_[i].goal.path_limits, plans.at});
      }
      return plans;
    }
    if (!slowsDown()) {
      const Order& order = orders_.front();
      GoalPlan own = planGoal(*order.axis, order.goal, plans.at);
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
  } catch (const std::range_error& error) {
    orders_.front().axis->refuse(error.what());
  }
  return plans;
}

std::vector<axis::Move> Manoeuvre::prepare() {
  prepared_ = plan(lead_);
  std::vector<axis::Move> moves;
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    const Planned& planned = prepared_->planned[i];
    const Goal& goal = orders_[i].goal;
    axis::Move move = moveOf(*orders_[i].axis, goal, planned.motion->made(), planned.overshoot);
    move.id = goal.move;
    move.outcome = goal.outcome;
    moves.push_back(std::move(move));
  }
  return moves;
}

// ---- orders to the engine ----

void Manoeuvre::order(Plans plans) {
  OpenOrder open;
  open.mode = mode_;
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
    follow.group = plans.path != nullptr ? group_ : 0;
    follow.stops = context_.stops_handled;
    follow.faults = axis.motor.state().faults();
    follow.slows = slowsDown();
    follow.settles = mode_ == Mode::kRun;
    follow.still = orders_[i].goal.motors.still;
    follow.squares = orders_[i].goal.motors.square;
    follow.is_square = orders_[i].goal.motors.are_square;
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
  path_ = plans.path;
  open.plans = std::move(plans);
  open_.push_back(std::move(open));
}

void Manoeuvre::begin(std::vector<Predecessor> predecessors, Ack call) {
  predecessors_ = std::move(predecessors);
  call_ = std::move(call);
  order(*std::exchange(prepared_, std::nullopt));
}

void Manoeuvre::beginStop(std::vector<Predecessor> predecessors, const Why& why) {
  predecessors_ = std::move(predecessors);
  started_ = true;
  stop(why);
  look();
}

bool Manoeuvre::anyMoves() const {
  return std::any_of(orders_.begin(), orders_.end(),
                     [](const Order& order) { return order.axis->moving(); });
}

void Manoeuvre::change(Mode mode, const Ack& call) {
  mode_ = mode;
  if (call) calls_.push_back(call);
  if (!anyMoves() && !held_) return calls_.clear();
  try {
    order(plan(lead_));
  } catch (const std::exception& error) {
    if (held_) return fail(failureOf(error));
    if (call) call->fail(failureOf(error));
    calls_.clear();
  }
}

void Manoeuvre::stop(const Why& why, const Ack& call) {
  if (over_) return;
  if (mode_ == Mode::kStop) {
    if (call && !open_.empty()) calls_.push_back(call);
    return;
  }
  why_ = why;
  if (anyMoves()) return change(Mode::kStop, call);
  if (held_) drop();  // otherwise it has come to rest by itself
}

// Gives up the goals that it held at rest.
void Manoeuvre::drop() {
  for (const Order& order : orders_) {
    activity::conclude(*order.axis, order.goal, droppedResult(order, &order == &orders_.front()));
  }
  result_ = droppedResult(orders_.front(), true);
  finish();
}

void Manoeuvre::hold(const Ack& call) {
  if (over_ || mode_ != Mode::kRun) return;
  if (orders_.front().goal.isStreamed()) return stop(kEndedByHold, call);
  change(Mode::kHold, call);
}

void Manoeuvre::refuseUnlessResumable() const {
  if (over_ || mode_ != Mode::kHold || anyMoves()) return;
  for (const Order& order : orders_) {
    order.axis->refuseUnlessReady();
    refuseIntoEndstop(order);
  }
}

void Manoeuvre::resume(const Ack& call) {
  if (over_ || mode_ != Mode::kHold) return;
  from_rest_ = !anyMoves();
  change(Mode::kRun, call);
  held_ = false;
}

void Manoeuvre::replan(const Ack& call) {
  if (over_ || mode_ != Mode::kRun || !anyMoves()) return;
  change(Mode::kRun, call);
}

// ---- news from the engine ----

bool Manoeuvre::isDone() const {
  return std::all_of(orders_.begin(), orders_.end(), [](const Order& order) {
    return order.axis->motor.state().end == pulse::EndReason::kDone;
  });
}

// Also while the engine has not handled what was ordered with it.
bool Manoeuvre::isOpen() const {
  if (open_.empty()) return false;
  const std::vector<pulse::Follow>& follows = *open_.back().follows;
  return std::any_of(follows.begin(), follows.end(), [this](const pulse::Follow& follow) {
    const motor::Motor& motor = context_.axes[static_cast<std::size_t>(follow.channel)]->motor;
    return motor.state().taken < follow.serial;
  });
}

bool Manoeuvre::look() {
  if (over_) return true;
  if (isOpen()) return false;
  if (!open_.empty()) {
    // Orders after a refused order are refused too.
    const std::vector<OpenOrder> orders = std::exchange(open_, {});
    for (const OpenOrder& order : orders) {
      if (wasAccepted(order)) accept(order);
    }
    if (wasAccepted(orders.back())) {
      calls_.clear();
    } else {
      refused();
    }
  }
  if (!over_ && open_.empty() && !anyMoves() && !held_) rested();
  return over_;
}

// The engine accepts an order for all of its axes or for no axis.
bool Manoeuvre::wasAccepted(const OpenOrder& order) const {
  for (std::size_t i = 0; i < orders_.size(); ++i) {
    const std::uint64_t serial = order.serials[i];
    if (serial != 0) return serial <= orders_[i].axis->motor.state().accepted;
  }
  return false;
}

void Manoeuvre::accept(const OpenOrder& order) {
  lead_ = kLead;
  if (!started_) {
    for (Order& own : orders_) own.goal.slipped_ns = context_.slipped;
  }
  started_ = true;
  from_rest_ = false;
  accepted_mode_ = order.mode;
  accepted_path_ = order.plans.path;
  for (const Predecessor& before : std::exchange(predecessors_, {})) {
    for (std::size_t i = 0; i < orders_.size(); ++i) {
      if (orders_[i].axis != before.axis || !order.plans.planned[i].motion) continue;
      tell(before.goal, replacedResult(before, orders_[i], *order.plans.planned[i].motion->plan()));
    }
  }
  call_.reset();
}

void Manoeuvre::refused() {
  path_ = accepted_path_;
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

void Manoeuvre::tryAgain() {
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
      throw Refused(orders_.front().axis->name() + ": " + why_.text);
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
void Manoeuvre::fail(Failure failure) {
  const bool is_resume = started_ && from_rest_;
  if (call_) call_->fail(failure);
  call_.reset();
  for (const Ack& call : std::exchange(calls_, {})) {
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

void Manoeuvre::rested() {
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
  concludeGoals();
  finish();
}

void Manoeuvre::concludeGoals() {
  for (const Order& order : orders_) {
    const axis::MoveResult result = resultOf(order);
    if (&order == &orders_.front()) result_ = result;
    activity::conclude(*order.axis, order.goal, result);
  }
}

void Manoeuvre::concludePredecessors() {
  for (const Predecessor& before : std::exchange(predecessors_, {})) {
    conclude(context_, before);
  }
}

void Manoeuvre::finish() {
  concludePredecessors();
  over_ = true;
  held_ = false;
  call_.reset();
  calls_.clear();
}

std::vector<Predecessor> Manoeuvre::handOver() {
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
  over_ = true;
  call_.reset();
  calls_.clear();
  return left;
}

const Goal* Manoeuvre::goalOf(const axis::AxisModel& axis) const {
  for (const Order& order : orders_) {
    if (order.axis == &axis) return &order.goal;
  }
  return nullptr;
}

// ---- how it ended, in words ----

void Manoeuvre::conclude(const Context& context, const Predecessor& ended) {
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

axis::MoveResult Manoeuvre::resultOf(const Order& order) const {
  const bool by_fault =
      why_.end == axis::MoveEnd::kFault || why_.end == axis::MoveEnd::kEmergencyStop;
  auto [end, why] = endOf(*order.axis, order.goal, accepted_mode_ != Mode::kRun,
                          {by_fault ? why_.end : axis::MoveEnd::kStopped, why_.text});
  if (end == axis::MoveEnd::kCompanion) why = endedWith(*order.axis);
  return resultWith(context_, *order.axis, order.goal, end, why);
}

std::string Manoeuvre::endedWith(const axis::AxisModel& axis) const {
  for (const Order& other : orders_) {
    const pulse::EndReason end = other.axis->motor.state().end;
    if (other.axis != &axis && end != pulse::EndReason::kDone &&
        end != pulse::EndReason::kCompanion) {
      return fmt::format("it moved together with {}, which was stopped", other.axis->name());
    }
  }
  return "an axis that it moved together with was stopped";
}

// For a goal that was held at rest.
axis::MoveResult Manoeuvre::droppedResult(const Order& order, bool by_it) const {
  if (by_it || orders_.size() == 1) {
    return resultWith(context_, *order.axis, order.goal, why_.end, why_.text);
  }
  return resultWith(
      context_, *order.axis, order.goal, axis::MoveEnd::kCompanion,
      fmt::format("it was held together with {}: {}", orders_.front().axis->name(), why_.text));
}

axis::MoveResult Manoeuvre::replacedResult(const Predecessor& before, const Order& by,
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
  return result;
}

}  // namespace stepdriver::activity
