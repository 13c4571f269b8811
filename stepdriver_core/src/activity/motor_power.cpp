#include "motor_power.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "context.h"
#include "gpio/chip_table.h"
#include "message_text.h"

namespace stepdriver::activity {
namespace {

// How often the feedback is read while it is waited for, if no edge is reported.
constexpr pulse::Nanoseconds kLookPeriod = 5'000'000;

}  // namespace

void MotorPower::switchOn() {
  if (!isWired()) return;
  wanted_ = true;
  off_at_.reset();
  failure_.clear();
}

void MotorPower::switchOff(pulse::Nanoseconds at, const SharedCall& call) {
  if (!isWired()) return;
  wanted_ = false;
  off_at_ = off_at_ ? std::min(*off_at_, at) : at;
  if (call && state_ != State::kOff && state_ != State::kLeaving) off_calls_.push_back(call);
}

void MotorPower::stopped(const Context& context) {
  if (isWired()) switchOff(context.now + config_->off_delay_ns);
}

std::string MotorPower::takeFailure() {
  return std::exchange(is_news_, false) ? failure_ : std::string();
}

pulse::Nanoseconds MotorPower::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  const auto add = [&](pulse::Nanoseconds time) {
    if (time > looked_at_) due = std::min(due, time);
  };
  if (state_ == State::kThere && off_at_) add(*off_at_);
  if (state_ == State::kComing) add(since_ + config_->on_ns);
  if (watchesInputs()) {
    add(std::min(since_ + config_->feedback_timeout_ns, looked_at_ + kLookPeriod));
  }
  return due;
}

bool MotorPower::watchesInputs() const {
  return hasFeedback() && (state_ == State::kLeaving || state_ == State::kComing);
}

bool MotorPower::poll(Context& context, bool may_go) {
  if (!isWired()) return false;
  looked_at_ = context.now;
  const State before = state_;
  const bool stepped = step(context, may_go);
  context.mode.powered = isThere();
  return stepped || state_ != before;
}

bool MotorPower::step(Context& context, bool may_go) {
  switch (state_) {
    case State::kOff:
      if (!wanted_) return false;
      // It may have failed to switch off.
      write(context, false);
      return true;
    case State::kLeaving:
      return leave(context);
    case State::kComing:
      return come(context);
    case State::kThere:
      return watch(context, may_go);
    case State::kSwitchingOn:
    case State::kSwitchingOff:
      break;
  }
  return endWrite(context);
}

bool MotorPower::leave(Context& context) {
  const Feedback now = feedback(context);
  if (hasFeedback() && (now.active || now.error != 0)) {
    const pulse::Nanoseconds waited = context.now - since_;
    if (waited < config_->feedback_timeout_ns) return false;
    state_ = State::kOff;
    return fail(context,
                now.error != 0
                    ? unreadable(context, now.error)
                    : fmt::format("the motor power is off, but its feedback line {} was still "
                                  "active after {}: its contacts may be welded",
                                  context.lines.input(lines_.feedback), millisecondsText(waited)));
  }
  if (wanted_) {
    write(context, true);
  } else {
    state_ = State::kOff;
  }
  return true;
}

bool MotorPower::come(Context& context) {
  if (!wanted_) {
    write(context, false);
    return true;
  }
  const Feedback now = feedback(context);
  const pulse::Nanoseconds waited = context.now - since_;
  if (now.active && waited >= config_->on_ns) {
    state_ = State::kThere;
    return true;
  }
  if (now.active || waited < config_->feedback_timeout_ns) return false;
  return fail(context,
              now.error != 0
                  ? unreadable(context, now.error)
                  : fmt::format("the motor power isn't there: its feedback line {} was still "
                                "inactive {} after the line {} had switched it on",
                                context.lines.input(lines_.feedback), millisecondsText(waited),
                                context.lines.output(lines_.output)));
}

bool MotorPower::watch(Context& context, bool may_go) {
  const Feedback now = feedback(context);
  if (now.error != 0) return fail(context, unreadable(context, now.error));
  if (!now.active) {
    return fail(context, fmt::format("the motor power was lost: its feedback line {} is inactive",
                                     context.lines.input(lines_.feedback)));
  }
  if (wanted_ || !may_go || context.now < *off_at_) return false;
  lose(context);
  write(context, false);
  return true;
}

void MotorPower::write(Context& context, bool on) {
  state_ = on ? State::kSwitchingOn : State::kSwitchingOff;
  job_ = context.newJob();
  context.out->pin_jobs.push_back({job_, lines_.output, config_->active_level == on});
}

bool MotorPower::endWrite(Context& context) {
  if (!context.pin_done || context.pin_done->id != job_) return false;
  const int error = context.pin_done->error;
  const bool switched_off = state_ == State::kSwitchingOff;
  state_ = switched_off ? State::kLeaving : State::kComing;
  since_ = context.now;
  const std::vector<SharedCall> calls =
      switched_off ? std::exchange(off_calls_, {}) : std::vector<SharedCall>();
  if (error == 0) return true;
  // Its feedback says nothing about a line that wasn't written.
  if (switched_off) state_ = State::kOff;
  const std::string why = fmt::format(
      "the motor power line {} can't be written: {}; check the cable and the supply of "
      "its chip",
      context.lines.output(lines_.output), gpio::errorText(error));
  for (const SharedCall& call : calls) call->fail({Failure::Kind::kGpio, why});
  // If it was to be switched on, it may have been.
  return fail(context, why);
}

MotorPower::Feedback MotorPower::feedback(const Context& context) const {
  if (!hasFeedback()) return {true, 0};
  const int level = context.levels.level(lines_.feedback);
  if (level < 0) return {false, -level};
  return {(level != 0) == config_->feedback->active_level, 0};
}

std::string MotorPower::unreadable(const Context& context, int error) const {
  return fmt::format("the motor power's feedback line {} can't be read: {}",
                     context.lines.input(lines_.feedback), gpio::errorText(error));
}

bool MotorPower::fail(Context& context, const std::string& why) {
  wanted_ = false;
  // What went wrong first is the reason of what follows.
  if (failure_.empty()) {
    failure_ = why;
    is_news_ = true;
  }
  if (state_ == State::kThere) lose(context);
  if (state_ == State::kThere || state_ == State::kComing) write(context, false);
  return true;
}

// As for any loss of current; and without their supply the chips forget their phases.
void MotorPower::lose(Context& context) {
  for (const auto& axis : context.axes) {
    const motor::Power& power = axis->motor.power();
    if (axis->moving()) axis->position.distrust();
    if (power.isEnabled() && !power.isAsleep()) axis->noteUnpowered();
    axis->noteSupplyLost();
  }
}

}  // namespace stepdriver::activity
