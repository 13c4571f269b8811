#include "homing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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
namespace {

using axis::HomingEnd;
using axis::HomingPhase;

// A switch that has not come to rest after this many debounce times is broken.
constexpr int kMostDebounces = 50;
// The polling period while a switch settles.
constexpr pulse::Nanoseconds kSamplePeriod = 1'000'000;

/// The motors that have a switch at the home end.
std::vector<std::size_t> homeSwitchesOf(const config::AxisConfig& axis) {
  std::vector<std::size_t> motors;
  for (std::size_t i = 0; i < axis.motors(); ++i) {
    const config::MotorConfig& motor = axis.motorAt(i);
    if (axis.homing->at_max ? motor.endstop_max : motor.endstop_min) motors.push_back(i);
  }
  return motors;
}

}  // namespace

Homing::Homing(Context& context, axis::AxisModel& axis, std::uint64_t id,
               std::shared_ptr<Result> outcome)
    : Activity(context, {&axis}, Handover::kAfterRest),
      axis_(axis),
      config_(*axis.config.homing),
      sides_(homeSwitchesOf(axis.config)),
      squares_(axis.config.motors() > 1 && sides_.size() == axis.config.motors()),
      towards_(config_.at_max ? 1.0 : -1.0),
      switch_(config_.at_max ? "the max switch" : "the min switch"),
      debounce_(nanoseconds(config_.debounce)),
      id_(id),
      outcome_(std::move(outcome)) {}

int Homing::lineOf(std::size_t side) const {
  const motor::ChipLines& lines = axis_.motor.lines().motorAt(side);
  return config_.at_max ? lines.endstop_max : lines.endstop_min;
}

// On the way off the switches all of them must open, on the way to them all must close.
bool Homing::isClosed() const {
  const bool arrives = phase_ == HomingPhase::kSeeking || phase_ == HomingPhase::kLatching;
  const auto closed = [this](std::size_t side) { return isClosed(side); };
  return arrives ? std::all_of(sides_.begin(), sides_.end(), closed)
                 : std::any_of(sides_.begin(), sides_.end(), closed);
}

std::string Homing::switchThatIs(bool closed) const {
  if (axis_.config.motors() == 1) return switch_;
  const auto found = std::find_if(sides_.begin(), sides_.end(),
                                  [&](std::size_t side) { return isClosed(side) == closed; });
  const std::size_t side = found != sides_.end() ? *found : sides_.front();
  return switch_ + " of motor " + axis_.config.motorAt(side).motor;
}

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
  if (axis_.motor.state().end == pulse::EndReason::kSkewed) {
    fail(fmt::format("{} didn't close within max_skew, {}, of another motor's", switchThatIs(false),
                     axis_.show(axis_.config.max_skew)));
    return onLook();
  }
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
      why = switchThatIs(true) + " didn't open" + travel;
      break;
    case HomingPhase::kSeeking:
      why = switchThatIs(false) + " didn't close" + travel;
      break;
    case HomingPhase::kLatching:
      why = switchThatIs(false) + " didn't close again" + travel;
      break;
    default:
      return squares_ && stroke_->goalOf(axis_)->motors.still != 0 ? align() : succeed();
  }
  fail(why);
  onLook();
}

void Homing::enter(HomingPhase phase) {
  phase_ = phase;
  phase_began_ = context().now;
  const double direction = leaves() ? -towards_ : towards_;
  bound_ = axis_.jointCount() +
           motion::restingCount(direction * config_.max_travel * axis_.stepsPerUnit());
  goOn();
}

void Homing::goOn() {
  slowing_ = false;
  slipped_before_ = context().slipped;
  Goal goal;
  goal.target = bound_;
  goal.velocity = phase_ == HomingPhase::kSeeking ? config_.seek_speed : config_.latch_speed;
  goal.motors.square = squares_ && !leaves();
  stroke(std::move(goal));
}

void Homing::stroke(Goal goal) {
  goal.measures = true;
  axis_.refuseUnlessReady();
  stroke_ = std::make_unique<MotionExecution>(context(), std::vector<Order>{{&axis_, goal}});
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
  for (const std::size_t side : sides_) {
    for (const gpio::EdgeEvent& edge : axis_.inputs.since(lineOf(side), steady_since_)) {
      steady_since_ = std::max<pulse::Nanoseconds>(steady_since_, edge.time_ns);
    }
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
      return closed_ ? align() : goOn();
  }
}

// ---- the trigger point ----

void Homing::keepLatch() {
  latched_ = axis_.motor.state();
  slipped_ = context().slipped;
  const motor::Motion* motion = axis_.motor.motions().find(latched_.ended);
  latch_ = motion != nullptr ? std::optional(motion->planned) : std::nullopt;
}

// The first edge of the burst that ended the latch: a contact that closes may bounce while the axis
// still makes steps.
std::optional<std::int64_t> Homing::triggerEdge() const {
  const std::int64_t end = latched_.end_time + slipped_;
  std::optional<std::int64_t> first;
  const std::size_t side = sides_.front();
  const auto edges = axis_.inputs.since(lineOf(side), phase_began_);
  const config::MotorConfig& motor = axis_.config.motorAt(side);
  const auto& endstop = config_.at_max ? motor.endstop_max : motor.endstop_min;
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    if (edge->level != endstop->active_level || edge->time_ns > end) continue;
    if (first && *first - edge->time_ns > debounce_) break;
    first = edge->time_ns;
  }
  return first;
}

double Homing::triggerCount() const {
  const auto slack = static_cast<double>(latched_.slack);
  const double count = towards_ * (static_cast<double>(latched_.count) + latched_.between);
  const auto edge = squares_ ? std::nullopt : triggerEdge();
  // An edge may be lost. The switch has closed between the last step and the one that wasn't made.
  if (!edge || !latch_) return towards_ * count - slack;
  double at = towards_ * latch_->made().stateAt(*edge - slipped_).position.value();
  at = std::min(at, count + 0.5);
  // It isn't known when in the latch the timeline slid, but the number of steps bounds the effect.
  if (slipped_ != slipped_before_) at = std::max(at, count - 0.5);
  return towards_ * at - slack;
}

// Each motor that squares stands at its own switch. Those whose switch closes earlier on the way
// than another's move off it, alone, until all are square.
void Homing::align() {
  if (phase_ != HomingPhase::kPullingOff) {
    phase_ = HomingPhase::kPullingOff;
    trigger_ = triggerCount();
    if (squares_) to_align_ = sides_;
  }
  const auto away = [this](std::size_t side) {
    return -towards_ * axis_.config.motorAt(side).offset;
  };
  double farthest = away(sides_.front());
  for (const std::size_t side : sides_) farthest = std::max(farthest, away(side));
  while (!to_align_.empty()) {
    const std::size_t side = to_align_.back();
    to_align_.pop_back();
    const std::int64_t steps = motion::restingCount((farthest - away(side)) * axis_.stepsPerUnit());
    if (steps == 0) continue;
    const std::int64_t by = towards_ > 0.0 ? -steps : steps;
    trigger_ += static_cast<double>(by);
    Goal goal;
    goal.target = axis_.motor.state().count + by;
    goal.of_motor = true;
    goal.velocity = config_.latch_speed;
    goal.motors.still =
        axis_.motor.allMotors() & static_cast<pulse::MotorSet>(~pulse::motorBit(side));
    return stroke(std::move(goal));
  }
  if (squares_) {
    trigger_ += towards_ * farthest * axis_.stepsPerUnit();
    skew_ = axis_.motor.skew();
    axis_.motor.noteSquare();
  }
  pullOff();
}

void Homing::pullOff() {
  Goal goal;
  goal.target = motion::restingCount(trigger_ - towards_ * config_.pull_off * axis_.stepsPerUnit());
  goal.velocity = config_.seek_speed;
  goal.motors.are_square = squares_;
  stroke(std::move(goal));
}

// ---- the end ----

std::string Homing::timeOver() const {
  const std::string within = fmt::format("within timeout_s, {} s", numberText(config_.timeout));
  if (phase_ == HomingPhase::kPullingOff) return "it didn't come to its end " + within;
  const bool leaving = phase_ == HomingPhase::kLeaving || phase_ == HomingPhase::kBackingOff;
  return fmt::format("{} didn't {} {}", switchThatIs(leaving), leaving ? "open" : "close", within);
}

void Homing::fail(const std::string& why, HomingEnd end, const SharedCall& call) {
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
  result_.skew = static_cast<double>(skew_) / axis_.stepsPerUnit();
  const std::string squared =
      squares_
          ? fmt::format(", its motors were {} apart",
                        config::distanceText(result_.skew, axis_.config.kind, axis_.stepsPerUnit()))
          : "";
  conclude(axis_.name() + " is homed" + squared + ", and stands at ", true);
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
