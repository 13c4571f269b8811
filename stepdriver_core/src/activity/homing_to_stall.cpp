#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "homing_kinds.h"
#include "profile/resting_count.h"

namespace stepdriver::activity {
namespace {

// How often the motor's speed is looked at.
constexpr pulse::Nanoseconds kLookEvery = 5'000'000;
// The load is read again so long after an answer, which itself takes 1.2 ms at 115200 baud: several
// times in a full step.
constexpr pulse::Nanoseconds kLoadEvery = 500'000;
// [full steps] The chip has measured the load at a constant speed after so many.
constexpr double kMeasuresIn = 4.0;
// [full steps] Two stalls at one place are at most so far apart; the electrical cycle has 4.
constexpr double kSamePlace = 2.0;
constexpr int kMostApproaches = 4;
// A speed that isn't below the wanted one by more is that one.
constexpr double kAtSpeed = 0.999;

}  // namespace

HomingToStall::HomingToStall(Context& context, axis::AxisModel& axis, std::uint64_t id,
                             std::shared_ptr<Result> outcome)
    : Homing(context, axis, id, std::move(outcome)),
      chip_(*axis.motor.tmcAt(0)),
      stall_(*chip_.config().stall) {}

double HomingToStall::fullStep() const { return axis_.motor.microsteps(); }

std::string HomingToStall::unmet() const {
  if (waits_ != Waits::kNothing && waits_ != Waits::kLoad) {
    return axis_.chipText(0) + " didn't take its registers";
  }
  if (phase() == axis::HomingPhase::kBackingOff) return "it didn't back off";
  return axis_.chipText(0) + " didn't detect a stall";
}

void HomingToStall::start() {
  if (const std::string limited = limitedSpeed(); !limited.empty()) return failNow(limited);
  enter(axis::HomingPhase::kSeeking, towards_);
  chip_.notePreparedForStall();
  post(chip_.prepareStall(), Waits::kPrepared);
}

// Below its speed the detection is never armed: the motor would press on until max_travel.
std::string HomingToStall::limitedSpeed() const {
  if (axis_.maxSpeed() >= kAtSpeed * config_.seek_speed) return "";
  return fmt::format("its speed is limited to {}, and its stall is detected at {} only",
                     axis_.show(axis_.maxSpeed(), "/s"), axis_.show(config_.seek_speed, "/s"));
}

void HomingToStall::speedChanged(const SharedCall& call) {
  const std::string limited = isApproach() ? limitedSpeed() : "";
  if (limited.empty()) return Homing::speedChanged(call);
  fail(limited, axis::HomingEnd::kFailed, call);
  poll();
}

// ---- the registers ----

void HomingToStall::post(bus::RegisterJob job, Waits waits) {
  job.id = job_ = context().newJob();
  waits_ = waits;
  context().out->register_jobs.push_back(std::move(job));
}

void HomingToStall::take(const bus::RegisterDone& done) {
  const Waits waited = std::exchange(waits_, Waits::kNothing);
  const std::string why =
      waited == Waits::kEnded ? chip_.takeEndOfStall(done) : chip_.takeStall(done);
  axis_.motor.noteChips();
  if (!why.empty()) {
    axis_.fault.latch(axis_.chipText(0) + " " + why, chip_.remedy());
    axis_.distrust();
    return failNow(axis_.fault.what());
  }
  switch (waited) {
    case Waits::kPrepared:
      audit_.begin(static_cast<int>(done.values.back()), axis_.motor.state().count);
      return approach();
    case Waits::kArmed:
      look_at_ = hasDiag() ? pulse::kNever : context().now;
      return;
    case Waits::kLoad:
      return noteLoad(done.values.back());
    case Waits::kDisarmed:
      return disarmed(static_cast<int>(done.values.back()));
    case Waits::kBackedOff:
      audit_.check(static_cast<int>(done.values.back()), axis_.motor.state().count,
                   axis_.motor.microsteps());
      return approach();
    case Waits::kEnded:
      return pullOff(trigger_);
    case Waits::kNothing:
      return;
  }
}

// ---- the approaches ----

void HomingToStall::approach() {
  if (const std::string limited = limitedSpeed(); !limited.empty()) return failNow(limited);
  ++approaches_;
  enter(approaches_ == 1 ? axis::HomingPhase::kSeeking : axis::HomingPhase::kLatching, towards_);
  armed_ = false;
  at_speed_since_ = pulse::kNever;
  look_at_ = context().now;
  Goal goal;
  goal.target = bound();
  goal.velocity = config_.seek_speed;
  goal.until_block = true;
  goal.ignores_override = true;
  begin(std::move(goal));
}

void HomingToStall::backOff() {
  enter(axis::HomingPhase::kBackingOff, -towards_);
  Goal goal;
  // An odd number of steps shows in which direction MSCNT counts.
  const std::int64_t place =
      motion::restingCount(trigger_ - towards_ * config_.pull_off * axis_.stepsPerUnit());
  const bool is_odd = (place - axis_.jointCount()) % 2 != 0;
  goal.target = is_odd ? place : place - static_cast<std::int64_t>(towards_);
  goal.velocity = config_.seek_speed;
  begin(std::move(goal));
}

pulse::Nanoseconds HomingToStall::lookDue() const {
  const bool watches = isApproach() && waits_ == Waits::kNothing;
  return watches ? look_at_ : pulse::kNever;
}

void HomingToStall::look(bool stroke_has_ended) {
  const auto& done = context().register_done;
  if (done && done->id == job_ && waits_ != Waits::kNothing) return take(*done);
  if (!stroke_has_ended) watch();
}

bool HomingToStall::isAtSpeed() const {
  const double speed = std::abs(axis_.motor.stateAt(context().motionNow()).velocity);
  return speed >= kAtSpeed * config_.seek_speed * axis_.stepsPerUnit();
}

void HomingToStall::watch() {
  if (!isApproach() || waits_ != Waits::kNothing || context().now < look_at_) return;
  look_at_ = context().now + kLookEvery;
  if (armed_) {
    if (!hasDiag()) post(chip_.readLoad(), Waits::kLoad);
    return;
  }
  if (!isAtSpeed()) {
    at_speed_since_ = pulse::kNever;
    return;
  }
  const double rate = config_.seek_speed * axis_.stepsPerUnit() / fullStep();
  at_speed_since_ = std::min(at_speed_since_, context().now);
  const auto measures = static_cast<pulse::Nanoseconds>(kMeasuresIn / rate * 1e9);
  if (context().now < at_speed_since_ + measures) return;
  armed_ = true;
  post(chip_.armStall(rate), Waits::kArmed);
}

// Without DIAG the load is read. The engine ends the motion as at DIAG.
void HomingToStall::noteLoad(std::uint32_t load) {
  look_at_ = context().now + kLoadEvery;
  if (!chip_.isStall(load)) return;
  pulse::Command command;
  command.kind = pulse::Command::Kind::kBlocked;
  command.channel = axis_.motor.channel();
  command.serial = axis_.motor.nextSerial();
  context().out->commands.push_back(command);
  look_at_ = pulse::kNever;
}

void HomingToStall::strokeEnded() {
  const axis::MoveEnd end = stroke()->result().end;
  if (end == axis::MoveEnd::kEndstopMin || end == axis::MoveEnd::kEndstopMax) {
    return failNow(fmt::format("the {} endstop was met while {}",
                               end == axis::MoveEnd::kEndstopMin ? "min" : "max", nameOf(phase())));
  }
  if (phase() == axis::HomingPhase::kPullingOff) {
    return succeed(trigger_, 0.0, fmt::format(" at MSCNT {}", mscnt_) + shiftText());
  }
  const bool is_blocked = axis_.motor.state().end == pulse::EndReason::kBlocked;
  endStroke();
  if (phase() == axis::HomingPhase::kBackingOff) {
    return post(chip_.disarmStall(), Waits::kBackedOff);
  }
  if (!is_blocked) {
    return failNow(unmet() + " within max_travel, " + axis_.show(config_.max_travel));
  }
  post(chip_.disarmStall(), Waits::kDisarmed);
}

// ---- the place of the stall ----

void HomingToStall::disarmed(int mscnt) {
  before_ = approaches_ > 1 ? std::optional(trigger_) : std::nullopt;
  trigger_ = axis_.exactCount();
  mscnt_ = mscnt;
  if (const std::string lost =
          audit_.check(mscnt, axis_.motor.state().count, axis_.motor.microsteps());
      !lost.empty()) {
    return failNow(axis_.chipText(0) + " " + lost);
  }
  if (stall_.phase && audit_.direction() != 0) {
    constexpr int kCycle = driver::tmc::kMscntPerCycle;
    const int away = ((*stall_.phase - mscnt) % kCycle + kCycle + kCycle / 2) % kCycle - kCycle / 2;
    trigger_ += audit_.direction() * away * fullStep() / driver::tmc::kFinest;
  }
  compare();
}

std::string HomingToStall::shiftText() const {
  if (!wasHomed()) return "";
  const double shift = axis_.positionOf(trigger_) - config_.offset;
  return fmt::format(", {} from where it was homed before", axis_.showPlace(shift));
}

// What stops one approach on the way, or keeps it from coming to its speed, doesn't stop the next.
void HomingToStall::compare() {
  if (before_ && std::abs(trigger_ - *before_) <= kSamePlace * fullStep()) {
    return post(chip_.endStall(), Waits::kEnded);
  }
  if (approaches_ == kMostApproaches) {
    return failNow(fmt::format(
        "{} approaches ended at different places, the last two {} apart: "
        "tmc/stall_threshold or tmc/stall_current_a doesn't suit",
        kMostApproaches, axis_.show(std::abs(trigger_ - *before_) / axis_.stepsPerUnit())));
  }
  backOff();
}

}  // namespace stepdriver::activity
