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

bool EngineChannel::reserve() {
  if (profile != nullptr || reserved) return false;
  reserved = true;
  faulty = false;  // to be read anew when the pins have done what they do
  return true;
}

void EngineChannel::release(const Command& command) {
  reserved = false;
  unchecked = config.fault.has_value();
  state.ready = std::max(state.ready, command.ready);
  if (const auto& scale = command.scale) {
    state.count = scale->count;
    state.slack = scale->slack;
    config.backlash = scale->backlash;
    ++state.epoch;
  }
}

void EngineChannel::countStep() {
  state.count += direction;
  state.slack = std::clamp<std::int64_t>(state.slack + direction, 0, config.backlash);
  ++state.pulses;
  state.rose = rose;
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
