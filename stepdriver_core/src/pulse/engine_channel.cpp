#include "engine_channel.h"

#include <algorithm>

#include "profile/resting_count.h"

namespace stepdriver::pulse {

void Kin::stepped(EngineChannel& channel, const PlayedStep& step) { channel.publishStep(step); }

bool Kin::follows() const {
  return std::any_of(axes.begin(), axes.end(),
                     [](const EngineChannel* axis) { return axis->motion->follows(); });
}

bool Kin::isRunning() const {
  return std::any_of(axes.begin(), axes.end(), [](const EngineChannel* axis) {
    return axis->motion->follows() && axis->motion->running();
  });
}

bool Kin::isReserved() const {
  return std::any_of(axes.begin(), axes.end(),
                     [](const EngineChannel* axis) { return axis->guard.reserved(); });
}

bool Kin::isBusy() const {
  return open != 0 || std::any_of(all.begin(), all.end(),
                                  [](const EngineChannel* channel) { return channel->lane.busy; });
}

// The n-th motor has the chip of the n-th axis, and its channel comes after those of all axes.
EngineChannel* Kin::axisOf(EngineChannel& channel) {
  const auto place = std::find(all.begin(), all.end(), &channel) - all.begin();
  return axes[static_cast<std::size_t>(place) % axes.size()];
}

EngineChannel& Kin::motorOf(EngineChannel& axis) {
  const auto place = std::find(axes.begin(), axes.end(), &axis) - axes.begin();
  return *all[all.size() - axes.size() + static_cast<std::size_t>(place)];
}

void SumKin::stepped(EngineChannel& channel, const PlayedStep& step) {
  channel.publishStep(step);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (all[axes.size() + i] == &channel) sum.stepped(i, channel.state.count);
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    ChannelState& state = axes[i]->state;
    state.count = sum.axis(i).count();
    state.between = sum.axis(i).place() - static_cast<double>(state.count);
    if (all[axes.size() + i] == &channel) {
      state.own = channel.state.count;
      state.pulses = channel.state.pulses;
      state.rose = channel.state.rose;
    }
    axes[i]->publish();
  }
}

void SumKin::halted() {
  for (EngineChannel* channel : all) {
    channel->state.rests_at = channel->motion->restsAt();
    channel->publish();
  }
}

void EngineChannel::follow(const Follow& order, Nanoseconds now) {
  group = order.group;
  slows = order.slows;
  arrives = order.arrives;
  const bool from_rest = !motion->follows();
  if (from_rest) {
    state.still = order.still;
    guard.begin({order.squares, order.is_square, order.until_block}, now);
    if (!kin->follows()) {
      for (EngineChannel* channel : kin->all) channel->late = channel->behind = 0;
    }
  }
  const bool settles = order.settles && guard.has(&MotorSignals::in_position);
  motion->follow({order.profile, order.serial, settles},
                 {order.restart_interval, config.late_steps * order.full_step});
  if (from_rest) adopted(true);
}

// Channels of its kin may have more steps after its end.
void EngineChannel::noteLastSteps() {
  if (!motion->endsAt()) return last_steps_.clear();
  if (!last_steps_.empty()) return;
  for (const EngineChannel* channel : kin->all) last_steps_.push_back(channel->put);
}

bool EngineChannel::isPlayed() const {
  for (std::size_t i = 0; i < last_steps_.size(); ++i) {
    if (kin->all[i]->over < last_steps_[i]) return false;
  }
  return !last_steps_.empty();
}

void EngineChannel::adopted(bool told) {
  last_steps_.clear();
  if (told) {
    state.following = motion->following();
  } else {
    if (untold_.size() == kMostUntold) tell(untold_.front().start);
    untold_.push_back({motion->following(), motion->profile().startNs()});
  }
  guard.adopted(motion->next().has_value() || kin->all.size() > 1);
}

void EngineChannel::tell(Nanoseconds motion_now) {
  const auto later = std::find_if(untold_.begin(), untold_.end(), [motion_now](const Untold& one) {
    return one.start > motion_now;
  });
  if (later == untold_.begin()) return;
  state.following = (later - 1)->serial;
  untold_.erase(untold_.begin(), later);
}

void EngineChannel::release(const Command& command) {
  guard.release();
  for (EngineChannel* channel : kin->all) {
    channel->state.ready = std::max(channel->state.ready, command.ready);
    channel->publish();
  }
  if (const auto& scale = command.scale) {
    state.count = scale->count;
    motion->rescale(scale->count);
    config.backlash = scale->backlash;
    config.switch_release = scale->switch_release;
    takeUp(scale->taken_up);
    ++state.epoch;
  }
}

// In a mode whose microsteps don't divide the backlash, the last step that takes it up is a part of
// one: without the exact sum, each change of the mode would move the joint by what was rounded.
void EngineChannel::takeUp(double of_backlash) {
  state.taken_up = std::clamp(of_backlash, 0.0, config.backlash);
  state.slack = motion::restingCount(state.taken_up);
}

void EngineChannel::publishStep(const PlayedStep& step) {
  state.count += step.direction;
  if (config.backlash > 0.0) takeUp(state.taken_up + step.direction);
  ++state.pulses;
  state.rose = step.time;
  if (step.still == 0) return published.storeFirst<kStepBytes>(state);
  for (std::size_t i = 0; i < guard.motors(); ++i) {
    if ((step.still & motorBit(i)) != 0) state.lags[i] -= step.direction;
  }
  publish();
}

void EngineChannel::endMotion(EndReason reason, bool abrupt, Nanoseconds motion_now) {
  // A failure after the end of a motion doesn't change how that motion ended.
  if (motion->follows()) {
    state.end = reason;
    state.end_abrupt = abrupt;
    state.ended = motion->latest();
    state.end_time = motion_now;
  }
  state.following = 0;
  untold_.clear();
  state.rests_at = motion->restsAt();
  motion->end();
  guard.end();
  publish();
}

}  // namespace stepdriver::pulse
