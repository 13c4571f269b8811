#include "engine_channel.h"

#include <algorithm>

namespace stepdriver::pulse {

void EngineChannel::pullNext() {
  motion::Step step;
  next.reset();
  if (finder.next(step)) next = step;
}

void EngineChannel::adopt(const motion::Profile& followed, std::uint64_t serial) {
  profile = &followed;
  finder = motion::StepFinder(followed, state.count);
  state.following = serial;
  pullNext();
}

void EngineChannel::follow(const Follow& order) {
  restart_interval = order.restart_interval;
  group = order.group;
  if (profile == nullptr) {
    adopt(*order.profile, order.serial);
    last_planned = order.profile->startNs();
    late = 0;
    running = false;
  } else {
    successors.add(*order.profile, order.serial);
  }
}

bool EngineChannel::startPins(const Command& command, Nanoseconds now) {
  if (profile != nullptr || pin_run.serial != 0) return false;
  const bool stepped = state.pulses != 0;
  pin_run = {command.pins, 0, command.serial, command.scale,
             stepped ? std::max(now, rose + config.mode_hold) : now};
  faulty = false;  // to be read anew when the pins have done what they do
  return true;
}

void EngineChannel::finishPins(Nanoseconds then_wait, Nanoseconds now) {
  state.ready = std::max(state.ready, now + then_wait);
  if (const auto& scale = pin_run.scale) {
    state.count = scale->count;
    state.slack = scale->slack;
    config.backlash = scale->backlash;
  }
  state.pins_done = pin_run.serial;
  pin_run.serial = 0;
  publish();
}

void EngineChannel::countStep() {
  state.count += direction;
  state.slack = std::clamp<std::int64_t>(state.slack + direction, 0, config.backlash);
  ++state.pulses;
  running = true;
  last_planned = next->time_ns;
  late = 0;
  pullNext();
  publish();
}

void EngineChannel::endMotion(EndReason reason, Nanoseconds motion_now) {
  // What fails after the motion was over leaves that motion's end as it was.
  if (profile != nullptr) {
    state.end = reason;
    state.end_abrupt = isFast();
    state.ended = latest();
    state.end_time = motion_now;
  }
  state.following = 0;
  profile = nullptr;
  successors.clear();
  next.reset();
  publish();
}

}  // namespace stepdriver::pulse
