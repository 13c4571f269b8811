#include <algorithm>

#include "engine_channel.h"
#include "pulse/pulse_engine.h"

namespace stepdriver::pulse {

using Action = EngineChannel::Action;

void PulseEngine::collectDue(Nanoseconds now) {
  due_.clear();
  dues_.collect(now, due_);
}

// Returns whether the timeline was slid, and others are due now.
bool PulseEngine::meetLateness(Nanoseconds now) {
  Nanoseconds excess = 0;
  for (const std::size_t index : due_) {
    Channel& channel = channels_[index];
    const Nanoseconds late = now - dues_[index];
    if (late == 0 || channel.action() != Action::kRise) continue;
    channel.late = std::max(channel.late, late);
    if (late > max_lateness_ && channel.isFast()) {
      channel.state.end_lateness = late;
      end(channel, EndReason::kTooLate, now);
      continue;
    }
    const auto absorbed =
        static_cast<Nanoseconds>((1.0 - kClosest) * static_cast<double>(channel.interval()));
    excess = std::max(excess, late - absorbed);
  }
  if (excess == 0) return false;
  slide(excess);
  scheduleAll();
  return true;
}

void PulseEngine::writeSteps(Nanoseconds now) {
  writes_.clear();
  writers_.clear();
  for (const std::size_t index : due_) {
    Channel& channel = channels_[index];
    const Action action = channel.action();
    const bool fall = action == Action::kFall;
    if (!fall && !(action == Action::kRise && mayStep(channel, now))) continue;
    const Signal& step = channel.config.step;
    // Member by member: a pair that is made first and then copied whole has the processor wait.
    gpio::LineWrite& write = writes_.emplace_back();
    write.output = step.line;
    write.level = step.active != fall;
    writers_.push_back(&channel);
  }
  // The reads of the switches took time, and a stop may have come in it; and what ended one channel
  // may have ended others.
  if (emergencyStopped()) stopAll(now);
  dropEnded();
  if (writes_.empty()) return;
  const std::uint64_t pulses = state_.pulses;
  const int error = lines_.write(writes_.data(), writes_.size());
  if (error != 0) {
    writeOneByOne(error, now);
  } else {
    const Nanoseconds done = clock_.now();
    for (Channel* channel : writers_) written(*channel, done);
  }
  if (state_.pulses != pulses) figures_.store(state_);
}

void PulseEngine::dropEnded() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    if (!writers_[i]->high && !writers_[i]->next) continue;
    writes_[kept] = writes_[i];
    writers_[kept++] = writers_[i];
  }
  writes_.resize(kept);
  writers_.resize(kept);
}

// One by one it shows whose line it is. What the write that failed has set already keeps its level.
void PulseEngine::writeOneByOne(int error, Nanoseconds now) {
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    Channel& channel = *writers_[i];
    errors_[i] = writers_.size() > 1 ? lines_.write(&writes_[i], 1) : error;
    const Nanoseconds done = clock_.now();
    if (errors_[i] == 0) {
      written(channel, done);
    } else {
      (channel.high ? channel.fell : channel.rose) = done;
      channel.high = false;
    }
  }
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    if (errors_[i] != 0) {
      fail(*writers_[i], {errors_[i], writes_[i].output}, now);
    }
  }
}

void PulseEngine::written(Channel& channel, Nanoseconds now) {
  changed(channel);
  channel.high = !channel.high;
  if (!channel.high) {
    channel.fell = now;
    return;
  }
  channel.rose = now;
  ++state_.pulses;
  state_.worst_lateness = std::max(state_.worst_lateness, channel.late);
  lateness_.add(now, channel.late);
  channel.countStep();
}

void PulseEngine::writeOthers(Nanoseconds now) {
  for (const std::size_t index : due_) {
    Channel& channel = channels_[index];
    switch (channel.action()) {
      case Action::kTurn:
        turn(channel, now);
        break;
      case Action::kFinish:
        end(channel, EndReason::kDone, now);
        break;
      default:
        break;
    }
  }
}

void PulseEngine::turn(Channel& channel, Nanoseconds now) {
  const bool forward = channel.next->direction > 0;
  const Signal& dir = channel.config.dir;
  const gpio::LineWrite write{dir.line, forward ? dir.active : !dir.active};
  if (const int error = lines_.write(&write, 1)) {
    fail(channel, {error, write.output}, now);
    return;
  }
  channel.turned = clock_.now();
  channel.direction = channel.next->direction;
  changed(channel);
}

void PulseEngine::fail(Channel& channel, const LineFailure& failure, Nanoseconds now) {
  channel.state.failure = failure;
  ++channel.state.line_errors;
  end(channel, EndReason::kLineError, now);
}

void PulseEngine::end(Channel& channel, EndReason reason, Nanoseconds now) {
  const bool together =
      channel.group != 0 && channel.profile != nullptr && reason != EndReason::kDone;
  endOne(channel, reason, now);
  if (!together) return;
  for (Channel& other : channels_) {
    if (other.profile != nullptr && other.group == channel.group) {
      endOne(other, EndReason::kCompanion, now);
    }
  }
}

void PulseEngine::endOne(Channel& channel, EndReason reason, Nanoseconds now) {
  channel.endMotion(reason, now - state_.slipped);
  news_ = true;
  changed(channel);
}

}  // namespace stepdriver::pulse
