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
  faulty = false;  // it must be read again when the pins have been written
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
  // A failure after the end of a motion doesn't change how that motion ended.
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
