#include "pulse/pulse_engine.h"

#include "engine_channel.h"

namespace stepdriver::pulse {

PulseEngine::PulseEngine(gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop)
    : lines_(lines),
      clock_(clock),
      max_lateness_(max_lateness),
      emergency_input_(emergency_stop),
      channels_(channels.size()),
      dues_(channels.size()) {
  for (std::size_t i = 0; i < channels.size(); ++i) {
    channels_[i].index = i;
    channels_[i].config = channels[i];
  }
  due_.reserve(channels.size());
  changed_.reserve(channels.size());
  writes_.reserve(channels.size());
  writers_.reserve(channels.size());
  errors_.resize(channels.size());
  readEmergencyStop();
}

PulseEngine::~PulseEngine() = default;

std::size_t PulseEngine::channels() const { return channels_.size(); }

ChannelState PulseEngine::channel(int index) const {
  return channels_.at(static_cast<std::size_t>(index)).published.load();
}

Nanoseconds PulseEngine::serve() {
  slid_ = false;
  if (mail_.front() != nullptr) takeMail(clock_.now());
  const Nanoseconds now = clock_.now();
  if (emergencyStopped()) stopAll(now);
  if (inputs_changed_.load(std::memory_order_relaxed) &&
      inputs_changed_.exchange(false, std::memory_order_acquire)) {
    readInputs(now);
  }
  collectDue(now);
  if (meetLateness(now)) collectDue(now);
  writeSteps(now);
  scheduleChanged();
  collectDue(now);
  writeOthers(now);
  scheduleChanged();
  serveStops();
  tell();
  return dues_.earliest();
}

void PulseEngine::tell() {
  if (!news_) return;
  news_ = false;
  if (listener_ != nullptr) listener_->onNews();
}

// ---- orders ----

bool PulseEngine::post(const Command& command) {
  if (!mail_.push(command)) return false;
  clock_.wake();
  return true;
}

void PulseEngine::takeMail(Nanoseconds now) {
  while (const Command* command = mail_.front()) {
    takeCommand(*command, now);
    mail_.pop();
  }
  news_ = true;
  // An order may slide the timeline, and then no step may go out by its old time.
  scheduleChanged();
}

void PulseEngine::takeCommand(const Command& command, Nanoseconds now) {
  if (command.kind == Command::Kind::kFollow) return followAll(command, now);
  Channel& channel = channels_[static_cast<std::size_t>(command.channel)];
  if (command.kind == Command::Kind::kRelease) {
    channel.release(command);
    channel.state.accepted = command.serial;
  } else if (channel.reserve()) {
    channel.state.accepted = command.serial;
  }
  channel.state.taken = command.serial;
  channel.publish();
  changed(channel);
}

void PulseEngine::followAll(const Command& command, Nanoseconds now) {
  bool may = true;
  for (std::size_t i = 0; i < command.follow_count; ++i) {
    may = may && mayFollow(command.follows[i], now);
  }
  for (std::size_t i = 0; i < command.follow_count; ++i) {
    const Follow& order = command.follows[i];
    Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
    if (may) {
      channel.follow(order);
      channel.state.accepted = order.serial;
      changed(channel);
    }
  }
  // What they wait for is there for all at once: `follows` is not read any more.
  for (std::size_t i = command.follow_count; i-- > 0;) {
    const Follow& order = command.follows[i];
    Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
    channel.state.taken = order.serial;
    channel.publish();
  }
}

bool PulseEngine::mayFollow(const Follow& order, Nanoseconds now) const {
  const Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
  const Nanoseconds start = order.profile->startNs();
  const bool late =
      start < now - state_.slipped || (channel.profile != nullptr && start < channel.last_planned);
  return !late && !channel.reserved && order.continues == channel.latest() &&
         channel.successors.hasRoom(start) && order.stops == stopsAsked() && !emergencyStopped();
}

}  // namespace stepdriver::pulse
