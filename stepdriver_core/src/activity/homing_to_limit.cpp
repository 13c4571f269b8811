#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "homing_kinds.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "profile/resting_count.h"

namespace stepdriver::activity {
namespace {

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

HomingToLimit::HomingToLimit(Context& context, axis::AxisModel& axis, std::uint64_t id,
                             std::shared_ptr<Result> outcome)
    : Homing(context, axis, id, std::move(outcome)),
      sides_(homeSwitchesOf(axis.config)),
      squares_(axis.config.motors() > 1 && sides_.size() == axis.config.motors()),
      switch_(config_.at_max ? "the max switch" : "the min switch"),
      debounce_(nanoseconds(config_.debounce)) {}

int HomingToLimit::lineOf(std::size_t side) const {
  const motor::ChipLines& lines = axis_.motor.lines().motorAt(side);
  return config_.at_max ? lines.endstop_max : lines.endstop_min;
}

// On the way off the switches all of them must open, on the way to them all must close.
bool HomingToLimit::isClosed() const {
  const bool arrives =
      phase() == axis::HomingPhase::kSeeking || phase() == axis::HomingPhase::kLatching;
  const auto closed = [this](std::size_t side) { return isClosed(side); };
  return arrives ? std::all_of(sides_.begin(), sides_.end(), closed)
                 : std::any_of(sides_.begin(), sides_.end(), closed);
}

std::string HomingToLimit::switchThatIs(bool closed) const {
  if (axis_.config.motors() == 1) return switch_;
  const auto found = std::find_if(sides_.begin(), sides_.end(),
                                  [&](std::size_t side) { return isClosed(side) == closed; });
  const std::size_t side = found != sides_.end() ? *found : sides_.front();
  return switch_ + " of motor " + axis_.config.motorAt(side).motor;
}

void HomingToLimit::start() {
  seek(isClosed() ? axis::HomingPhase::kLeaving : axis::HomingPhase::kSeeking);
}

void HomingToLimit::look(bool /*stroke_has_ended*/) {
  if (settling_) return sample();
  if (leaves() && !slowing_ && !isClosed()) {
    slowing_ = true;
    stroke()->stop({axis::MoveEnd::kStopped, switch_ + " opened"});
  }
}

pulse::Nanoseconds HomingToLimit::lookDue() const {
  return settling_ ? context().now + kSamplePeriod : pulse::kNever;
}

std::string HomingToLimit::unmet() const {
  const bool leaving =
      phase() == axis::HomingPhase::kLeaving || phase() == axis::HomingPhase::kBackingOff;
  return fmt::format("{} didn't {}", switchThatIs(leaving), leaving ? "open" : "close");
}

// ---- strokes ----

bool HomingToLimit::leaves() const {
  return !settling_ &&
         (phase() == axis::HomingPhase::kLeaving || phase() == axis::HomingPhase::kBackingOff);
}

void HomingToLimit::strokeEnded() {
  if (axis_.motor.state().end == pulse::EndReason::kSkewed) {
    return failNow(fmt::format("{} didn't close within max_skew, {}, of another motor's",
                               switchThatIs(false), axis_.show(axis_.config.max_skew)));
  }
  const axis::MoveEnd end = stroke()->result().end;
  const axis::MoveEnd own =
      config_.at_max ? axis::MoveEnd::kEndstopMax : axis::MoveEnd::kEndstopMin;
  if (end == axis::MoveEnd::kReached || end == axis::MoveEnd::kStopped) return reachedEnd();
  if (end != own) {
    const pulse::AxisEnd home = config_.at_max ? pulse::AxisEnd::kMax : pulse::AxisEnd::kMin;
    if (axis_.config.switch_release > 0.0 && axis_.motor.state().pressed == home) {
      return failNow(axis_.metText(!config_.at_max) + " while " + nameOf(phase()));
    }
    return failNow(fmt::format("the {} endstop was met while {}", config_.at_max ? "min" : "max",
                               nameOf(phase())));
  }
  if (phase() == axis::HomingPhase::kLatching) keepLatch();
  settle();
}

void HomingToLimit::reachedEnd() {
  const std::string travel = " within max_travel, " + axis_.show(config_.max_travel);
  switch (phase()) {
    case axis::HomingPhase::kLeaving:
    case axis::HomingPhase::kBackingOff:
      if (slowing_) return settle();
      return failNow(switchThatIs(true) + " didn't open" + travel);
    case axis::HomingPhase::kSeeking:
      return failNow(switchThatIs(false) + " didn't close" + travel);
    case axis::HomingPhase::kLatching:
      return failNow(switchThatIs(false) + " didn't close again" + travel);
    default:
      break;
  }
  if (squares_ && stroke()->goalOf(axis_)->motors.still != 0) return align();
  const double skew = static_cast<double>(skew_) / axis_.stepsPerUnit();
  succeed(trigger_, skew,
          squares_
              ? fmt::format(", its motors were {} apart",
                            config::distanceText(skew, axis_.config.kind, axis_.stepsPerUnit()))
              : "");
}

void HomingToLimit::seek(axis::HomingPhase phase) {
  const bool away = phase == axis::HomingPhase::kLeaving || phase == axis::HomingPhase::kBackingOff;
  enter(phase, away ? -towards_ : towards_);
  goOn();
}

void HomingToLimit::goOn() {
  slowing_ = false;
  slipped_before_ = context().slipped;
  Goal goal;
  goal.target = bound();
  goal.velocity = phase() == axis::HomingPhase::kSeeking ? config_.seek_speed : config_.latch_speed;
  goal.motors.square = squares_ && !leaves();
  begin(std::move(goal));
}

// ---- the switch ----

void HomingToLimit::settle() {
  endStroke();
  settling_.emplace(debounce_, isClosed(), context().now);
  sample();
}

void HomingToLimit::sample() {
  const bool closed = isClosed();
  pulse::Nanoseconds last_edge =
      closed != settling_->closed() ? context().now : settling_->steadySince();
  for (const std::size_t side : sides_) {
    for (const gpio::EdgeEvent& edge : axis_.inputs.since(lineOf(side), last_edge)) {
      last_edge = std::max<pulse::Nanoseconds>(last_edge, edge.time_ns);
    }
  }
  switch (settling_->sample(closed, last_edge, context().now)) {
    case SwitchSettling::State::kWaits:
      return;
    case SwitchSettling::State::kSettled:
      settling_.reset();
      return settled(closed);
    case SwitchSettling::State::kBounces:
      break;
  }
  const pulse::Nanoseconds began = settling_->began();
  settling_.reset();
  failNow(fmt::format(
      "{} bounces without end: after {} it still hasn't been at rest for debounce_ms, {}", switch_,
      millisecondsText(context().now - began), millisecondsText(debounce_)));
}

// A level that did not last is a glitch: the phase continues.
void HomingToLimit::settled(bool closed) {
  switch (phase()) {
    case axis::HomingPhase::kLeaving:
      return closed ? goOn() : seek(axis::HomingPhase::kSeeking);
    case axis::HomingPhase::kSeeking:
      return closed ? seek(axis::HomingPhase::kBackingOff) : goOn();
    case axis::HomingPhase::kBackingOff:
      return closed ? goOn() : seek(axis::HomingPhase::kLatching);
    default:
      break;
  }
  if (!closed) return goOn();
  trigger_ = triggerCount();
  if (squares_) to_align_ = sides_;
  align();
}

// ---- the trigger point ----

void HomingToLimit::keepLatch() {
  latched_ = axis_.motor.state();
  slipped_ = context().slipped;
  const motor::Motion* motion = axis_.motor.motions().find(latched_.ended);
  latch_ = motion != nullptr ? std::optional(motion->planned) : std::nullopt;
}

// The first edge of the burst that ended the latch: a contact that closes may bounce while the axis
// still makes steps.
std::optional<std::int64_t> HomingToLimit::triggerEdge() const {
  const std::int64_t end = latched_.end_time + slipped_;
  std::optional<std::int64_t> first;
  const std::size_t side = sides_.front();
  const auto edges = axis_.inputs.since(lineOf(side), phaseBegan());
  const config::MotorConfig& motor = axis_.config.motorAt(side);
  const auto& endstop = config_.at_max ? motor.endstop_max : motor.endstop_min;
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    if (edge->level != endstop->active_level || edge->time_ns > end) continue;
    if (first && *first - edge->time_ns > debounce_) break;
    first = edge->time_ns;
  }
  return first;
}

double HomingToLimit::triggerCount() const {
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
void HomingToLimit::align() {
  enter(axis::HomingPhase::kPullingOff, -towards_);
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
    return begin(std::move(goal));
  }
  if (squares_) {
    trigger_ += towards_ * farthest * axis_.stepsPerUnit();
    skew_ = axis_.motor.skew();
    axis_.motor.noteSquare();
  }
  MotorsTogether motors;
  motors.are_square = squares_;
  pullOff(trigger_, motors);
}

}  // namespace stepdriver::activity
