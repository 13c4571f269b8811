#include "homing.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "homing_kinds.h"
#include "homing_to_flag.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "profile/resting_count.h"
#include "stepdriver_core/error.h"
#include "steps.h"

namespace stepdriver::axis {

const char* nameOf(HomingPhase phase) {
  switch (phase) {
    case HomingPhase::kNone:
      return "none";
    case HomingPhase::kLeaving:
      return "leaving";
    case HomingPhase::kSeeking:
      return "seeking";
    case HomingPhase::kBackingOff:
      return "backing off";
    case HomingPhase::kLatching:
      return "latching";
    case HomingPhase::kPullingOff:
      return "pulling off";
    case HomingPhase::kStopping:
      return "stopping";
  }
  return "";
}

}  // namespace stepdriver::axis

namespace stepdriver::activity {

using axis::HomingEnd;
using axis::HomingPhase;

Homing::Homing(Context& context, axis::AxisModel& axis, std::uint64_t id,
               std::shared_ptr<Result> outcome)
    : Activity(context, {&axis}, Handover::kAfterRest),
      axis_(axis),
      config_(*axis.config.homing),
      towards_(config_.at_max ? 1.0 : -1.0),
      id_(id),
      outcome_(std::move(outcome)) {}

std::unique_ptr<Homing> Homing::make(Context& context, axis::AxisModel& axis, std::uint64_t id,
                                     std::shared_ptr<Result> outcome) {
  switch (axis.config.homing->kind) {
    case config::HomingKind::kBlock:
      return std::make_unique<HomingToBlock>(context, axis, id, std::move(outcome));
    case config::HomingKind::kFlag:
    case config::HomingKind::kFlagCentre:
    case config::HomingKind::kIndex:
      return std::make_unique<HomingToFlag>(context, axis, id, std::move(outcome));
    case config::HomingKind::kDirect:
      return std::make_unique<HomingInPlace>(context, axis, id, std::move(outcome));
    case config::HomingKind::kStall:
      return std::make_unique<HomingToStall>(context, axis, id, std::move(outcome));
    case config::HomingKind::kLimit:
      break;
  }
  return std::make_unique<HomingToLimit>(context, axis, id, std::move(outcome));
}

void Homing::refuseUnlessReady(const axis::AxisModel& axis) {
  if (!axis.config.homing) axis.refuse("homing isn't configured: homing/switch is missing");
  axis.refuseUnlessReady();
  axis.refuseWhileHeld();
  axis.refuseHomingOnSharedSwitch();
}

void Homing::onBegin(std::vector<Predecessor> /*predecessors*/) {
  was_homed_ = axis_.position.isHomed();
  axis_.position.beginHoming();
  axis_.is_being_homed = true;
  deadline_ = context().now + nanoseconds(config_.timeout);
  // A hold came while it waited for its axis.
  if (context().mode.held) held_since_ = context().now;
  waking_ = wakeSteps(context(), axis_);
  try {
    if (!waking_.empty()) waking_.front()->begin();
    onLook();
  } catch (const Error& error) {
    fail(error.what());
  }
}

void Homing::onAbandon(const EarlyEnd& why) {
  failure_ = fmt::format("{} isn't homed: {}", axis_.name(), why.text);
  conclude(failure_ + "; it stands at ", true);
}

void Homing::onEnd(const EarlyEnd& why, const SharedCall& call) {
  fail(why.text, HomingEnd::kFailed, call);
  onLook();
}

void Homing::cancelHomings(const std::vector<std::uint64_t>& ids) {
  if (std::find(ids.begin(), ids.end(), id_) == ids.end()) return;
  fail("it was cancelled", HomingEnd::kCancelled);
  poll();
}

std::vector<Predecessor> Homing::handOver(const std::string& by) {
  std::vector<Predecessor> left = stroke_->handOver();
  result_.end = HomingEnd::kFailed;
  failure_ = fmt::format("{} isn't homed: {}", axis_.name(), by);
  conclude(failure_, false);
  return left;
}

void Homing::hold(const SharedCall& call) {
  if (!isHeld()) held_since_ = context().now;
  if (stroke_) stroke_->hold(call);
}

void Homing::refuseUnlessResumable() const {
  if (stroke_) stroke_->refuseUnlessResumable();
}

void Homing::resume(const SharedCall& call) {
  if (!isHeld()) return;
  if (stroke_) stroke_->resume(call);
  deadline_ += context().now - *held_since_;
  held_since_.reset();
}

void Homing::speedChanged(const SharedCall& call) {
  if (stroke_) stroke_->replan(call);
}

pulse::Nanoseconds Homing::due() const {
  if (!waking_.empty()) return waking_.front()->due();
  if (phase_ == HomingPhase::kStopping || isHeld()) return pulse::kNever;
  return std::min(deadline_, lookDue());
}

void Homing::onLook() {
  try {
    step();
  } catch (const Error& error) {
    waking_.clear();  // its pins could not be written
    fail(error.what());
    if (stroke_ == nullptr && !isFinished()) {
      conclude(failure_ + "; it stands at ", true);
    }
  }
}

void Homing::step() {
  while (!waking_.empty()) {
    if (!waking_.front()->poll()) return;
    waking_.erase(waking_.begin());
    if (phase_ == HomingPhase::kStopping) waking_.clear();
    if (!waking_.empty()) waking_.front()->begin();
  }
  const bool ended = stroke_ == nullptr || stroke_->poll();
  if (phase_ == HomingPhase::kStopping) {
    if (ended) conclude(failure_ + "; it stands at ", true);
    return;
  }
  if (axis_.fault) {
    fail(axis_.fault.what());
    return onLook();
  }
  if (phase_ != HomingPhase::kNone) observe();
  if (isHeld()) return;
  if (phase_ == HomingPhase::kNone) {
    axis_.refuseHomingOnSharedSwitch();
    return start();
  }
  if (context().now >= deadline_) return failNow(timeOver());
  if (stroke_ != nullptr && ended) {
    if (stroke_->failure()) throw Refused(stroke_->failure()->text);
    return strokeEnded();
  }
  look(ended);
}

// ---- strokes ----

void Homing::enter(HomingPhase phase, double direction) {
  phase_ = phase;
  phase_began_ = context().now;
  bound_ = axis_.jointCount() +
           motion::restingCount(direction * config_.max_travel * axis_.stepsPerUnit());
}

void Homing::begin(Goal goal) {
  presses_ = presses_ || goal.until_block;
  goal.measures = true;
  axis_.refuseUnlessReady();
  stroke_ = std::make_unique<MotionExecution>(context(), std::vector<Order>{{&axis_, goal}});
  stroke_->prepare();
  stroke_->begin({}, nullptr);
}

void Homing::pullOff(double trigger, const MotorsTogether& motors) {
  phase_ = HomingPhase::kPullingOff;
  const double way = config_.final_position ? *config_.final_position - config_.offset
                                            : -towards_ * config_.pull_off;
  Goal goal;
  goal.target = motion::restingCount(trigger + way * axis_.stepsPerUnit());
  goal.velocity = config_.seek_speed;
  goal.motors = motors;
  begin(std::move(goal));
}

// ---- the end ----

std::string Homing::timeOver() const {
  const std::string within = fmt::format(" within timeout_s, {} s", numberText(config_.timeout));
  return (phase_ == HomingPhase::kPullingOff ? "it didn't come to its end" : unmet()) + within;
}

void Homing::fail(const std::string& why, HomingEnd end, const SharedCall& call) {
  if (phase_ != HomingPhase::kStopping) {
    phase_ = HomingPhase::kStopping;
    failure_ = fmt::format("{} isn't homed: {}", axis_.name(), why);
    result_.end = end;
  }
  if (stroke_) stroke_->stop({axis::MoveEnd::kStopped, why}, call);
}

void Homing::failNow(const std::string& why) {
  fail(why);
  onLook();
}

void Homing::succeed(double trigger, double skew, const std::string& remark) {
  axis_.position.home(config_.offset - trigger / axis_.stepsPerUnit());
  result_.end = HomingEnd::kHomed;
  result_.skew = skew;
  conclude(axis_.name() + " is homed" + remark + ", and stands at ", true);
}

void Homing::conclude(const std::string& message, bool stands) {
  phase_ = HomingPhase::kNone;
  axis_.is_being_homed = false;
  if (presses_ && result_.end != HomingEnd::kHomed) axis_.distrust();
  stroke_.reset();
  result_.axis = axis_.name();
  result_.position = axis_.positionNow();
  result_.message = message;
  if (stands) result_.message += axis_.showPlace(result_.position);
  outcome_->set(result_);
  finish();
}

}  // namespace stepdriver::activity
