#include "homing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "message_text.h"
#include "nanoseconds.h"
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
namespace {

using axis::HomingEnd;
using axis::HomingPhase;

// A switch that has not come to rest after this many debounce times is broken.
constexpr int kMostDebounces = 50;
// The polling period while a switch settles.
constexpr pulse::Nanoseconds kSamplePeriod = 1'000'000;

}  // namespace

Homing::Homing(Context& context, axis::AxisModel& axis, std::uint64_t id,
               std::shared_ptr<Result> outcome)
    : Activity(context, {&axis}, Handover::kAfterRest),
      axis_(axis),
      config_(*axis.config.homing),
      endstop_(config_.at_max ? axis.config.endstop_max : axis.config.endstop_min),
      line_(config_.at_max ? axis.motor.lines().endstop_max : axis.motor.lines().endstop_min),
      towards_(config_.at_max ? 1.0 : -1.0),
      switch_(config_.at_max ? "the max switch" : "the min switch"),
      debounce_(nanoseconds(config_.debounce)),
      id_(id),
      outcome_(std::move(outcome)) {}

void Homing::refuseUnlessReady(const axis::AxisModel& axis) {
  if (!axis.config.homing) axis.refuse("homing isn't configured: homing/switch is missing");
  axis.refuseUnlessReady();
  axis.refuseWhileHeld();
}

void Homing::onBegin(std::vector<Predecessor> /*predecessors*/) {
  axis_.position.beginHoming();
  deadline_ = context().now + nanoseconds(config_.timeout);
  waking_ = wakeSteps(context(), axis_);
  try {
    if (!waking_.empty()) waking_.front()->begin();
    onLook();
  } catch (const Error& error) {
    fail(error.what());
  }
}

void Homing::onAbandon(const Why& why) {
  failure_ = fmt::format("{} isn't homed: {}", axis_.name(), why.text);
  conclude(failure_ + "; it stands at ", true);
}

void Homing::onEnd(const Why& why, const Ack& call) {
  fail(why.text, HomingEnd::kFailed, call);
  onLook();
}

void Homing::cancelHomings(const std::vector<std::uint64_t>& ids) {
  if (std::find(ids.begin(), ids.end(), id_) == ids.end()) return;
  fail("it was cancelled", HomingEnd::kCancelled);
  look();
}

std::vector<Predecessor> Homing::handOver(const std::string& by) {
  std::vector<Predecessor> left = stroke_->handOver();
  result_.end = HomingEnd::kFailed;
  failure_ = fmt::format("{} isn't homed: {}", axis_.name(), by);
  conclude(failure_, false);
  return left;
}

void Homing::hold(const Ack& call) {
  if (!isHeld()) held_since_ = context().now;
  if (stroke_) stroke_->hold(call);
}

void Homing::refuseUnlessResumable() const {
  if (stroke_) stroke_->refuseUnlessResumable();
}

void Homing::resume(const Ack& call) {
  if (!isHeld()) return;
  if (stroke_) stroke_->resume(call);
  deadline_ += context().now - *held_since_;
  held_since_.reset();
}

void Homing::speedChanged(const Ack& call) {
  if (stroke_) stroke_->replan(call);
}

pulse::Nanoseconds Homing::due() const {
  if (!waking_.empty()) return waking_.front()->due();
  if (phase_ == HomingPhase::kStopping || isHeld()) return pulse::kNever;
  if (!settling_) return deadline_;
  return std::min(deadline_, context().now + kSamplePeriod);
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
    if (!waking_.front()->look()) return;
    waking_.erase(waking_.begin());
    if (phase_ == HomingPhase::kStopping) waking_.clear();
    if (!waking_.empty()) waking_.front()->begin();
  }
  const bool ended = stroke_ == nullptr || stroke_->look();
  if (phase_ == HomingPhase::kStopping) {
    if (ended) conclude(failure_ + "; it stands at ", true);
    return;
  }
  if (axis_.fault) {
    fail(axis_.fault.what());
    return onLook();
  }
  if (isHeld()) return;
  if (phase_ == HomingPhase::kNone) {
    return enter(isClosed() ? HomingPhase::kLeaving : HomingPhase::kSeeking);
  }
  if (context().now >= deadline_) {
    fail(timeOver());
    return onLook();
  }
  if (settling_) return sample();
  if (ended) return strokeEnded();
  if (leaves() && !slowing_ && !isClosed()) {
    slowing_ = true;
    stroke_->stop({axis::MoveEnd::kStopped, switch_ + " opened"});
  }
}

// ---- strokes ----

bool Homing::leaves() const {
  return !settling_ && (phase_ == HomingPhase::kLeaving || phase_ == HomingPhase::kBackingOff);
}

void Homing::strokeEnded() {
  if (stroke_->failure()) throw Refused(stroke_->failure()->text);
  const axis::MoveEnd end = stroke_->result().end;
  const axis::MoveEnd own =
      config_.at_max ? axis::MoveEnd::kEndstopMax : axis::MoveEnd::kEndstopMin;
  if (end == axis::MoveEnd::kReached || end == axis::MoveEnd::kStopped) return rested();
  if (end != own) {
    fail(fmt::format("the {} endstop was met while {}", config_.at_max ? "min" : "max",
                     nameOf(phase_)));
    return onLook();
  }
  if (phase_ == HomingPhase::kLatching) keepLatch();
  settle();
}

void Homing::rested() {
  const std::string travel = " within max_travel, " + axis_.show(config_.max_travel);
  std::string why;
  switch (phase_) {
    case HomingPhase::kLeaving:
    case HomingPhase::kBackingOff:
      if (slowing_) return settle();
      why = switch_ + " didn't open" + travel;
      break;
    case HomingPhase::kSeeking:
      why = switch_ + " didn't close" + travel;
      break;
    case HomingPhase::kLatching:
      why = switch_ + " didn't close again" + travel;
      break;
    default:
      return succeed();
  }
  fail(why);
  onLook();
}

void Homing::enter(HomingPhase phase) {
  phase_ = phase;
  phase_began_ = context().now;
  const double direction = leaves() ? -towards_ : towards_;
  bound_ = axis_.jointCount() + std::llround(direction * config_.max_travel * axis_.stepsPerUnit());
  goOn();
}

void Homing::goOn() {
  slowing_ = false;
  slipped_before_ = context().slipped;
  stroke(bound_, phase_ == HomingPhase::kSeeking ? config_.seek_speed : config_.latch_speed);
}

void Homing::stroke(std::int64_t target, double speed) {
  axis_.refuseUnlessReady();
  Goal goal;
  goal.target = target;
  goal.velocity = speed;
  stroke_ = std::make_unique<Manoeuvre>(context(), std::vector<Order>{{&axis_, goal}});
  stroke_->prepare();
  stroke_->begin({}, nullptr);
}

// ---- the switch ----

void Homing::settle() {
  stroke_.reset();
  settling_ = true;
  closed_ = isClosed();
  settle_began_ = steady_since_ = context().now;
  sample();
}

void Homing::sample() {
  const bool closed = isClosed();
  if (closed != closed_) steady_since_ = context().now;
  closed_ = closed;
  for (const gpio::EdgeEvent& edge : axis_.inputs.since(line_, steady_since_)) {
    steady_since_ = std::max<pulse::Nanoseconds>(steady_since_, edge.time_ns);
  }
  if (context().now - steady_since_ >= debounce_) return settled();
  if (context().now - settle_began_ > kMostDebounces * debounce_) {
    fail(fmt::format(
        "{} bounces without end: after {} it still hasn't been at rest for debounce_ms, {}",
        switch_, millisecondsText(context().now - settle_began_), millisecondsText(debounce_)));
    onLook();
  }
}

// A level that did not last is a glitch: the phase continues.
void Homing::settled() {
  settling_ = false;
  switch (phase_) {
    case HomingPhase::kLeaving:
      return closed_ ? goOn() : enter(HomingPhase::kSeeking);
    case HomingPhase::kSeeking:
      return closed_ ? enter(HomingPhase::kBackingOff) : goOn();
    case HomingPhase::kBackingOff:
      return closed_ ? goOn() : enter(HomingPhase::kLatching);
    default:
      return closed_ ? pullOff() : goOn();
  }
}

// ---- the trigger point ----

void Homing::keepLatch() {
  latched_ = axis_.motor.state();
  slipped_ = context().slipped;
  const motor::Motion* motion = axis_.motor.motions().find(latched_.ended);
  latch_profile_ = motion != nullptr ? motion->profile : nullptr;
}

// The first edge of the burst that ended the latch: a contact that closes may bounce while the axis
// still makes steps.
std::optional<std::int64_t> Homing::triggerEdge() const {
  const std::int64_t end = latched_.end_time + slipped_;
  std::optional<std::int64_t> first;
  const auto edges = axis_.inputs.since(line_, phase_began_);
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    if (edge->level != endstop_->active_level || edge->time_ns > end) continue;
    if (first && *first - edge->time_ns > debounce_) break;
    first = edge->time_ns;
  }
  return first;
}

double Homing::triggerCount() const {
  const auto slack = static_cast<double>(latched_.slack);
  const double count = towards_ * static_cast<double>(latched_.count);
  const auto edge = triggerEdge();
  // An edge may be lost. The switch has closed between the last step and the one that wasn't made.
  if (!edge || !latch_profile_) return towards_ * count - slack;
  double at = towards_ * latch_profile_->stateAt(*edge - slipped_).position.value();
  at = std::min(at, count + 0.5);
  // It isn't known when in the latch the timeline slid, but the number of steps bounds the effect.
  if (slipped_ != slipped_before_) at = std::max(at, count - 0.5);
  return towards_ * at - slack;
}

void Homing::pullOff() {
  trigger_ = triggerCount();
  phase_ = HomingPhase::kPullingOff;
  stroke(std::llround(trigger_ - towards_ * config_.pull_off * axis_.stepsPerUnit()),
         config_.seek_speed);
}

// ---- the end ----

std::string Homing::timeOver() const {
  const std::string within = fmt::format("within timeout_s, {} s", numberText(config_.timeout));
  if (phase_ == HomingPhase::kPullingOff) return "it didn't come to its end " + within;
  const bool leaving = phase_ == HomingPhase::kLeaving || phase_ == HomingPhase::kBackingOff;
  return fmt::format("{} didn't {} {}", switch_, leaving ? "open" : "close", within);
}

void Homing::fail(const std::string& why, HomingEnd end, const Ack& call) {
  if (phase_ != HomingPhase::kStopping) {
    phase_ = HomingPhase::kStopping;
    failure_ = fmt::format("{} isn't homed: {}", axis_.name(), why);
    result_.end = end;
  }
  settling_ = false;
  if (stroke_) stroke_->stop({axis::MoveEnd::kStopped, why}, call);
}

void Homing::succeed() {
  axis_.position.home(config_.offset - trigger_ / axis_.stepsPerUnit());
  result_.end = HomingEnd::kHomed;
  conclude(axis_.name() + " is homed, and stands at ", true);
}

void Homing::conclude(const std::string& message, bool stands) {
  phase_ = HomingPhase::kNone;
  stroke_.reset();
  result_.axis = axis_.name();
  result_.position = axis_.positionNow();
  result_.message = message;
  if (stands) result_.message += axis_.showPlace(result_.position);
  outcome_->set(result_);
  finish();
}

}  // namespace stepdriver::activity
