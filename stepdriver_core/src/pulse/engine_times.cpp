#include <algorithm>

#include "engine_channel.h"
#include "pulse/pulse_engine.h"

namespace stepdriver::pulse {

using Action = EngineChannel::Action;

void PulseEngine::changed(Channel& channel) {
  if (channel.changed) return;
  channel.changed = true;
  changed_.push_back(&channel);
}

void PulseEngine::scheduleChanged() {
  bool slid = false;
  for (Channel* channel : changed_) {
    channel->changed = false;
    slid = schedule(*channel) || slid;
  }
  changed_.clear();
  if (slid) scheduleAll();
}

void PulseEngine::scheduleAll() {
  // A slide moves what was scheduled before it; it can't be followed by another for the same
  // reason.
  bool slid = true;
  while (slid) {
    slid = false;
    for (Channel& channel : channels_) slid = schedule(channel) || slid;
  }
}

bool PulseEngine::schedule(Channel& channel) {
  while (!channel.high && channel.isSucceeded()) {
    const Successors::Entry first = channel.successors.takeFirst();
    channel.adopt(*first.profile, first.serial);
    channel.publish();
  }
  Nanoseconds due = kNever;
  bool slid = false;
  switch (channel.action()) {
    case Action::kRise:
      return scheduleRise(channel);
    case Action::kNothing:
      break;
    case Action::kFall:
      due = channel.rose + channel.config.step_high;
      // What a slow write takes from the next interval belongs to the same slip as its lateness.
      slid = channel.next && !channel.isSucceeded() &&
             slideUpTo(closestRise(channel), channel.next->time_ns + state_.slipped);
      break;
    case Action::kTurn:
      due = channel.state.pulses != 0 ? channel.rose + channel.config.dir_hold : 0;
      break;
    case Action::kFinish:
      due = channel.profile->endNs() + state_.slipped;
      break;
  }
  dues_.set(channel.index, due);
  return slid;
}

// As near as the next step may come to the last one.
Nanoseconds PulseEngine::closestRise(const Channel& channel) {
  return channel.rose +
         static_cast<Nanoseconds>(kClosest * static_cast<double>(channel.interval()));
}

bool PulseEngine::scheduleRise(Channel& channel) {
  const ChannelConfig& config = channel.config;
  Nanoseconds earliest = std::max(channel.state.ready, channel.turned + config.dir_setup);
  if (channel.state.pulses != 0) {
    earliest = std::max({earliest, channel.fell + config.step_low, closestRise(channel)});
  }
  const Nanoseconds planned = channel.next->time_ns + state_.slipped;
  dues_.set(channel.index, std::max(planned, earliest));
  return slideUpTo(earliest, planned);
}

bool PulseEngine::slideUpTo(Nanoseconds earliest, Nanoseconds planned) {
  if (earliest <= planned) return false;
  slide(earliest - planned);
  return true;
}

void PulseEngine::slide(Nanoseconds by) {
  state_.slipped += by;
  if (!slid_) ++state_.slips;
  slid_ = true;
  figures_.store(state_);
}

}  // namespace stepdriver::pulse
