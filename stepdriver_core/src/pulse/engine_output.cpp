#include "pulse/engine_output.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::pulse {
namespace {

// What readers see of an output may be so old: an output that is switched at a high rate doesn't
// keep the controller busy.
constexpr Nanoseconds kTellEvery = 10'000'000;
// How soon a write is known to have failed that another thread makes.
constexpr Nanoseconds kLookEvery = 1'000'000;

}  // namespace

void EngineOutput::follow(const FollowMarks& order) {
  if (!marks_.follows()) {
    if (!order.begins || state_.ended == order.group) return;
    state_.group = order.group;
    adopt(order.changes, order.written);
  }
  marks_.follow({order.along, order.marks, order.axes, order.serial});
}

// The state of the output when an order begins, unless that doesn't know the last change yet.
void EngineOutput::adopt(std::uint64_t changes, const WrittenOutput& written) {
  if (changes == state_.changes) state_.written = written;
  state_.too_long = false;
}

bool EngineOutput::end() {
  if (!marks_.follows()) return false;
  state_.ended = std::exchange(state_.group, 0);
  state_.ended_made = marks_.made();
  marks_.end();
  publish();
  return true;
}

void EngineOutput::taken(std::uint64_t serial) {
  state_.taken = serial;
  publish();
}

// An output that was switched early, or by OutputLine::max_on, keeps its least times: the mark then
// comes late.
Nanoseconds EngineOutput::markDue(Nanoseconds slipped) const {
  if (!marks_.due()) return kNever;
  const Nanoseconds due = *marks_.due() + slipped;
  return marks_.setting().on == state_.written.setting.on ? due : std::max(due, mayChange());
}

Nanoseconds EngineOutput::tooLongAt() const {
  return state_.written.setting.on && line_.max_on != kNever
             ? state_.written.on_since + line_.max_on
             : kNever;
}

Nanoseconds EngineOutput::due(Nanoseconds slipped) const {
  const Nanoseconds told = std::min(untold_ ? tell_at_ : kNever, late_ ? late_->look_at : kNever);
  if (channel_ >= 0) {
    return std::min({compareDue(slipped), isWritten() ? tooLongAt() : kNever, told});
  }
  return marks_.follows() ? std::min({markDue(slipped), tooLongAt(), told}) : told;
}

bool EngineOutput::serve(Nanoseconds now, Nanoseconds slipped, PinRing* ring) {
  bool worked = endLateWrites(now);
  while (serveMark(now, slipped, ring) || serveCompare(now, slipped, ring)) worked = true;
  if (worked) publish();
  untold_ = untold_ || worked;
  const bool tell = untold_ && (now >= tell_at_ || (worked && !state_.due));
  if (!tell) return false;
  untold_ = false;
  tell_at_ = now + kTellEvery;
  return true;
}

// @return whether something was due
bool EngineOutput::serveMark(Nanoseconds now, Nanoseconds slipped, PinRing* ring) {
  if (!marks_.follows()) return false;
  if (markDue(slipped) <= now) {
    state_.too_long = false;
    if (write(marks_.setting(), now, ring)) marks_.advance();
  } else if (tooLongAt() <= now) {
    state_.too_long = true;
    write({}, now, ring);
  } else {
    return false;
  }
  return true;
}

// ---- the position of an axis ----

void EngineOutput::compare(const Compare& order, double joint) {
  endCompare();
  adopt(order.changes, order.written);
  channel_ = order.channel;
  state_.compare = order.serial;
  compare_.begin(*order.track, joint);
  rests_ = compare_.isOnHere();
}

void EngineOutput::endCompare() {
  channel_ = -1;
  state_.compare = 0;
  state_.muted = false;
  reached_ = false;
  rests_.reset();
  pulse_ends_ = kNever;
  compare_.clear();
}

bool EngineOutput::mute() {
  if (!isWritten()) return false;
  state_.muted = true;
  rests_.reset();
  pulse_ends_ = kNever;
  publish();
  return true;
}

void EngineOutput::axisEnded(Nanoseconds motion_now, double joint, bool reached) {
  if (!compare_.follows()) return;
  compare_.end(motion_now, joint);
  reached_ = reached && compare_.track()->pulse_at_end;
}

Nanoseconds EngineOutput::compareDue(Nanoseconds slipped) const {
  Nanoseconds due = pulse_ends_;
  if (rests_) due = std::min(due, *rests_ == state_.written.setting.on ? 0 : mayChange());
  if (reached_) due = 0;
  if (!compare_.due()) return due;
  const Nanoseconds next = *compare_.due() + slipped;
  const CompareAction action = compare_.action();
  const bool changes =
      isWritten() && ((action == CompareAction::kOn && !state_.written.setting.on) ||
                      (action == CompareAction::kOff && state_.written.setting.on));
  return std::min(due, changes ? std::max(next, mayChange()) : next);
}

bool EngineOutput::serveCompare(Nanoseconds now, Nanoseconds slipped, PinRing* ring) {
  if (channel_ < 0) return false;
  switch (compare_.takeUndone()) {
    case CompareAction::kOn:
      rests_ = true;
      break;
    case CompareAction::kOff:
      rests_ = false;
      break;
    default:
      break;
  }
  if (state_.muted) rests_.reset();
  if (pulse_ends_ <= now) {
    pulse_ends_ = kNever;
    write({}, now, ring);
  } else if (tooLongAt() <= now && isWritten()) {
    state_.too_long = true;
    write({}, now, ring);
  } else if (rests_ && (*rests_ == state_.written.setting.on || mayChange() <= now)) {
    write({*std::exchange(rests_, std::nullopt)}, now, ring);
  } else if (compareDue(slipped) <= now) {
    if (std::exchange(reached_, false)) {
      act(CompareAction::kPulse, now, ring);
    } else {
      // A newer action is made instead of what still waits for its time.
      if (compare_.action() != CompareAction::kNothing) rests_.reset();
      act(compare_.action(), now, ring);
      compare_.advance();
    }
  } else {
    return false;
  }
  return true;
}

void EngineOutput::act(CompareAction action, Nanoseconds now, PinRing* ring) {
  if (action == CompareAction::kNothing) return;
  const bool may =
      action == CompareAction::kPulse ? !state_.written.setting.on && mayChange() <= now : true;
  if (!isWritten() || !may) {
    ++state_.missed;
    return;
  }
  state_.too_long = false;
  if (!write({action != CompareAction::kOff}, now, ring)) {
    ++state_.missed;
    return;
  }
  ++state_.compared;
  if (action == CompareAction::kPulse)
    pulse_ends_ = state_.written.changed + compare_.track()->pulse;
}

// ---- all ----

// @return whether it has that state; otherwise the path's part has ended.
bool EngineOutput::write(const OutputSetting& setting, Nanoseconds now, PinRing* ring) {
  if (setting == state_.written.setting) return true;
  const gpio::LineWrite write{line_.output, setting.on == line_.active, setting.part};
  if (const int error = lines_.write(&write, 1)) {
    fail(error);
    return false;
  }
  if (const gpio::LateWrites late = lines_.lateWrites(line_.output); late.ordered != 0 && !late_) {
    late_ = Late{late.ordered, late.ended,    now + kLookEvery, 0,
                 state_.group, marks_.made(), state_.compared};
  }
  WrittenOutput& last = state_.written;
  const bool is_switched = setting.on != last.setting.on;
  last.setting = setting;
  last.changed = clock_.now();
  if (is_switched) last.switched = last.changed;
  if (is_switched && setting.on) last.on_since = now;
  ++state_.changes;
  if (is_switched && ring != nullptr) ring->addChange(write.output, write.level, last.changed);
  return true;
}

void EngineOutput::fail(int error) {
  ++state_.failures;
  state_.error = error;
  end();
  mute();
}

// @return whether all have ended now, or one has failed
bool EngineOutput::endLateWrites(Nanoseconds now) {
  if (!late_ || now < late_->look_at) return false;
  const gpio::LateWrites writes = lines_.lateWrites(line_.output);
  if (writes.ended != std::exchange(late_->ended, writes.ended)) late_->looks = 0;
  const bool failed = writes.failed >= late_->first;
  const bool ended = writes.ended >= writes.ordered;
  const bool hangs = !ended && ++late_->looks * kLookEvery >= line_.write_timeout;
  if (!failed && !ended && !hangs) {
    late_->look_at = now + kLookEvery;
    return false;
  }
  const Late late = *std::exchange(late_, std::nullopt);
  if (!failed && !hangs) return true;
  fail(failed ? writes.error : ETIMEDOUT);
  // What has been ordered since then counts as not made.
  if (state_.ended == late.group) state_.ended_made = std::min(state_.ended_made, late.made);
  state_.missed += state_.compared - late.compared;
  state_.compared = late.compared;
  return true;
}

void EngineOutput::publish() {
  state_.reads = state_.compare != 0 ? state_.compare : marks_.reads();
  state_.made = marks_.follows() ? marks_.made() : 0;
  state_.due = marks_.due().has_value() || pulse_ends_ != kNever || late_;
  published_.store(state_);
}

}  // namespace stepdriver::pulse
