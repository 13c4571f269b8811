#include "pulse/engine_output.h"

#include <algorithm>
#include <utility>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::pulse {
namespace {

// What readers see of an output may be so old: an output that is switched at a high rate doesn't
// keep the controller busy.
constexpr Nanoseconds kTellEvery = 10'000'000;

}  // namespace

void EngineOutput::follow(const FollowMarks& order) {
  if (!marks_.follows()) {
    if (!order.begins || state_.ended == order.group) return;
    state_.group = order.group;
    // Otherwise the order doesn't know the last change yet.
    if (order.changes == state_.changes) {
      state_.on = order.on;
      state_.changed = order.changed;
      state_.on_since = order.on_since;
    }
    state_.too_long = false;
    state_.error = 0;
  }
  marks_.follow({order.along, order.marks, order.delay, order.serial});
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
  if (marks_.on() == state_.on) return due;
  return std::max(due, state_.changed + (state_.on ? line_.min_on : line_.min_off));
}

Nanoseconds EngineOutput::tooLongAt() const {
  return state_.on && line_.max_on != kNever ? state_.on_since + line_.max_on : kNever;
}

Nanoseconds EngineOutput::due(Nanoseconds slipped) const {
  const Nanoseconds told = untold_ ? tell_at_ : kNever;
  return marks_.follows() ? std::min({markDue(slipped), tooLongAt(), told}) : told;
}

bool EngineOutput::serve(Nanoseconds now, Nanoseconds slipped, PinRing* ring) {
  bool worked = false;
  while (marks_.follows()) {
    const Nanoseconds mark = markDue(slipped);
    if (mark <= now) {
      state_.too_long = false;
      if (write(marks_.on(), now, ring)) marks_.advance();
    } else if (tooLongAt() <= now) {
      state_.too_long = true;
      write(false, now, ring);
    } else {
      break;
    }
    worked = true;
  }
  if (worked) publish();
  untold_ = untold_ || worked;
  const bool tell = untold_ && (now >= tell_at_ || (worked && !state_.due));
  if (!tell) return false;
  untold_ = false;
  tell_at_ = now + kTellEvery;
  return true;
}

// @return whether it has that state; otherwise the path's part has ended.
bool EngineOutput::write(bool on, Nanoseconds now, PinRing* ring) {
  if (on == state_.on) return true;
  const gpio::LineWrite write{line_.output, on == line_.active};
  if (const int error = lines_.write(&write, 1)) {
    state_.error = error;
    end();
    return false;
  }
  state_.on = on;
  state_.changed = clock_.now();
  if (on) state_.on_since = now;
  ++state_.changes;
  if (ring != nullptr) ring->addChange(write.output, write.level, state_.changed);
  return true;
}

void EngineOutput::publish() {
  state_.reads = marks_.reads();
  state_.made = marks_.follows() ? marks_.made() : 0;
  state_.due = marks_.due().has_value();
  published_.store(state_);
}

}  // namespace stepdriver::pulse
