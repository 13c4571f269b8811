#include "stepdriver_core/pulse/pulse_engine.h"

#include <algorithm>

namespace stepdriver::pulse {

PulseEngine::PulseEngine(gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop)
    : lines_(lines),
      clock_(clock),
      max_lateness_(max_lateness),
      emergency_input_(emergency_stop),
      channels_(channels.size()) {
  for (std::size_t i = 0; i < channels.size(); ++i) channels_[i].config = channels[i];
  writes_.reserve(channels.size());
  writers_.reserve(channels.size());
  errors_.resize(channels.size());
  readEmergencyStop();
}

bool PulseEngine::post(const Command& command) {
  if (!mail_.push(command)) return false;
  clock_.wake();
  return true;
}

void PulseEngine::inputsChanged() {
  inputs_changed_.store(true, std::memory_order_release);
  clock_.wake();
}

ChannelState PulseEngine::channel(int index) const {
  return channels_.at(static_cast<std::size_t>(index)).published.load();
}

Nanoseconds PulseEngine::serve() {
  takeMail(clock_.now());
  for (;;) {
    const Nanoseconds now = clock_.now();
    if (emergencyStopped()) stopAll(now);
    if (inputs_changed_.exchange(false, std::memory_order_acquire)) readInputs(now);
    meetLateness(now);
    writeSteps(now);
    scheduleAll();
    writeOthers(now);
    scheduleAll();
    Nanoseconds due = kNever;
    for (const Channel& channel : channels_) due = std::min(due, channel.due);
    if (due > clock_.now()) return due;
  }
}

PulseEngine::Action PulseEngine::actionOf(const Channel& channel) {
  if (channel.high) return Action::kFall;
  if (channel.pins_serial != 0) return Action::kPin;
  if (channel.next) {
    return channel.next->direction == channel.direction ? Action::kRise : Action::kTurn;
  }
  return channel.profile != nullptr ? Action::kFinish : Action::kNothing;
}

bool PulseEngine::isDue(const Channel& channel, Action action, Nanoseconds now) {
  return channel.due <= now && actionOf(channel) == action;
}

Nanoseconds PulseEngine::interval(const Channel& channel) {
  return channel.next->time_ns - channel.last_planned;
}

bool PulseEngine::isFast(const Channel& channel) {
  return channel.running && channel.next && interval(channel) < channel.restart_interval;
}

// ---- orders ----

void PulseEngine::Successors::add(const motion::Profile& profile, std::uint64_t serial) {
  while (size > 0 && entries[size - 1].profile->startNs() >= profile.startNs()) --size;
  entries[size++] = {&profile, serial};
}

PulseEngine::Successors::Entry PulseEngine::Successors::takeFirst() {
  const Entry first = entries[0];
  std::copy(entries.begin() + 1, entries.begin() + static_cast<std::ptrdiff_t>(size),
            entries.begin());
  --size;
  return first;
}

std::uint64_t PulseEngine::latest(const Channel& channel) {
  const Successors& successors = channel.successors;
  return successors.empty() ? channel.state.following
                            : successors.entries[successors.size - 1].serial;
}

void PulseEngine::takeMail(Nanoseconds now) {
  if (mail_.front() == nullptr) return;
  while (const Command* command = mail_.front()) {
    if (command->kind == Command::Kind::kFollow) {
      followAll(*command, now);
    } else {
      Channel& channel = channels_[static_cast<std::size_t>(command->channel)];
      startPins(channel, *command, now);
      channel.state.taken = command->serial;
      channel.published.store(channel.state);
    }
    mail_.pop();
  }
  // All of them: an order may slide the timeline, and then no step may go out by its old time.
  scheduleAll();
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
      follow(channel, order);
    } else {
      channel.state.refused = order.serial;
    }
  }
  // What they wait for is there for all at once: `follows` is not read any more.
  for (std::size_t i = command.follow_count; i-- > 0;) {
    const Follow& order = command.follows[i];
    Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
    channel.state.taken = order.serial;
    channel.published.store(channel.state);
  }
}

bool PulseEngine::mayFollow(const Follow& order, Nanoseconds now) const {
  const Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
  const Nanoseconds start = order.profile->startNs();
  const bool late =
      start < now - state_.slipped || (channel.profile != nullptr && start < channel.last_planned);
  return !late && channel.pins_serial == 0 && order.continues == latest(channel) &&
         channel.successors.hasRoom(start);
}

void PulseEngine::follow(Channel& channel, const Follow& order) {
  channel.restart_interval = order.restart_interval;
  channel.group = order.group;
  if (channel.profile == nullptr) {
    adopt(channel, *order.profile, order.serial);
    channel.last_planned = order.profile->startNs();
    channel.running = false;
  } else {
    channel.successors.add(*order.profile, order.serial);
  }
}

void PulseEngine::startPins(Channel& channel, const Command& command, Nanoseconds now) {
  if (channel.profile != nullptr || channel.pins_serial != 0) {
    channel.state.refused = command.serial;
    return;
  }
  channel.pins = command.pins;
  channel.pin = 0;
  channel.pins_serial = command.serial;
  channel.pins_scale = command.scale;
  channel.faulty = false;  // to be read anew when the pins have done what they do
  channel.pin_due = now;
  if (channel.state.pulses != 0) {
    channel.pin_due = std::max(now, channel.rose + channel.config.mode_hold);
  }
}

void PulseEngine::adopt(Channel& channel, const motion::Profile& profile, std::uint64_t serial) {
  channel.profile = &profile;
  channel.finder = motion::StepFinder(profile, channel.state.count);
  channel.state.following = serial;
  pullNext(channel);
}

void PulseEngine::pullNext(Channel& channel) {
  motion::Step step;
  channel.next.reset();
  if (channel.finder.next(step)) channel.next = step;
}

// ---- edges ----

void PulseEngine::stopAll(Nanoseconds now) {
  for (Channel& channel : channels_) {
    if (channel.profile != nullptr) end(channel, EndReason::kEmergencyStop, now);
  }
}

void PulseEngine::readInputs(Nanoseconds now) {
  readEmergencyStop();
  if (emergencyStopped()) stopAll(now);
  for (Channel& channel : channels_) {
    if (channel.config.fault) readFault(channel, now);
    if (channel.next) mayStep(channel, now);
  }
}

void PulseEngine::readFault(Channel& channel, Nanoseconds now) {
  // While its pins change, and while it wakes, a chip's fault line means nothing.
  if (channel.pins_serial != 0 || now < channel.state.ready) return;
  const int level = lines_.read(channel.config.fault->line);
  const bool faulty = level < 0 || (level != 0) == channel.config.fault->active;
  if (faulty && !channel.faulty) {
    if (level < 0) {
      fail(channel, {-level, channel.config.fault->line, true}, now);
    } else {
      ++channel.state.chip_faults;
      end(channel, EndReason::kChipFault, now);
    }
  }
  channel.faulty = faulty;
}

void PulseEngine::meetLateness(Nanoseconds now) {
  Nanoseconds excess = 0;
  for (Channel& channel : channels_) {
    if (!isDue(channel, Action::kRise, now)) continue;
    const Nanoseconds late = now - channel.due;
    state_.worst_lateness = std::max(state_.worst_lateness, late);
    lateness_.add(now, late);
    if (late > max_lateness_ && isFast(channel)) {
      channel.state.end_lateness = late;
      end(channel, EndReason::kTooLate, now);
      continue;
    }
    const auto absorbed =
        static_cast<Nanoseconds>((1.0 - kClosest) * static_cast<double>(interval(channel)));
    excess = std::max(excess, late - absorbed);
  }
  if (excess == 0) return;
  slide(excess);
  scheduleAll();
}

bool PulseEngine::mayStep(Channel& channel, Nanoseconds now) {
  const bool forward = channel.next->direction > 0;
  const auto& endstop = forward ? channel.config.endstop_max : channel.config.endstop_min;
  if (!endstop) return true;
  const int level = lines_.read(endstop->line);
  if (level < 0) {
    fail(channel, {-level, endstop->line, true}, now);
    return false;
  }
  if ((level != 0) != endstop->active) return true;
  end(channel, forward ? EndReason::kEndstopMax : EndReason::kEndstopMin, now);
  return false;
}

void PulseEngine::writeSteps(Nanoseconds now) {
  writes_.clear();
  writers_.clear();
  for (Channel& channel : channels_) {
    const bool fall = isDue(channel, Action::kFall, now);
    if (!fall && !(isDue(channel, Action::kRise, now) && mayStep(channel, now))) continue;
    const Signal& step = channel.config.step;
    writes_.push_back({step.line, fall ? !step.active : step.active});
    writers_.push_back(&channel);
  }
  // The reads of the switches took time, and a stop may have come in it; and what ended one channel
  // may have ended others.
  if (emergencyStopped()) stopAll(now);
  dropEnded();
  if (writes_.empty()) return;
  const int error = lines_.write(writes_.data(), writes_.size());
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    // One by one it shows whose line it is. What the write has set already keeps its level.
    errors_[i] = error != 0 && writers_.size() > 1 ? lines_.write(&writes_[i], 1) : error;
    written(*writers_[i], errors_[i] == 0);
  }
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    if (errors_[i] != 0) fail(*writers_[i], {errors_[i], writes_[i].output}, now);
  }
  figures_.store(state_);
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

void PulseEngine::written(Channel& channel, bool done) {
  const bool fall = channel.high;
  channel.high = !fall && done;
  (fall ? channel.fell : channel.rose) = clock_.now();
  if (done) ++state_.edges;
  if (fall || !done) return;
  channel.state.count += channel.direction;
  channel.state.slack =
      std::clamp<std::int64_t>(channel.state.slack + channel.direction, 0, channel.config.backlash);
  ++channel.state.pulses;
  channel.running = true;
  ++state_.pulses;
  channel.last_planned = channel.next->time_ns;
  pullNext(channel);
  channel.published.store(channel.state);
}

void PulseEngine::writeOthers(Nanoseconds now) {
  for (Channel& channel : channels_) {
    if (channel.due > now) continue;
    switch (actionOf(channel)) {
      case Action::kTurn:
        turn(channel, now);
        break;
      case Action::kPin:
        writePin(channel, now);
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
}

void PulseEngine::writePin(Channel& channel, Nanoseconds now) {
  if (channel.pin == channel.pins.size) {
    pinsDone(channel, 0, now);
    return;
  }
  const PinSequence::Write& pin = channel.pins.writes[channel.pin++];
  const gpio::LineWrite write{pin.line, pin.level};
  if (const int error = lines_.write(&write, 1)) {
    channel.state.pins_failed = channel.pins_serial;
    channel.pins_serial = 0;
    fail(channel, {error, write.output}, now);
    return;
  }
  const Nanoseconds written = clock_.now();
  channel.pin_due = written + pin.then_wait;
  if (channel.pin == channel.pins.size) pinsDone(channel, pin.then_wait, written);
}

void PulseEngine::pinsDone(Channel& channel, Nanoseconds then_wait, Nanoseconds now) {
  channel.state.ready = std::max(channel.state.ready, now + then_wait);
  if (const auto& scale = channel.pins_scale) {
    channel.state.count = scale->count;
    channel.state.slack = scale->slack;
    channel.config.backlash = scale->backlash;
  }
  channel.state.pins_done = channel.pins_serial;
  channel.pins_serial = 0;
  channel.published.store(channel.state);
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
  // What fails after the motion was over leaves that motion's end as it was.
  if (channel.profile != nullptr) {
    channel.state.end = reason;
    channel.state.end_abrupt = isFast(channel);
    channel.state.ended = latest(channel);
    channel.state.end_time = now - state_.slipped;
  }
  channel.state.following = 0;
  channel.profile = nullptr;
  channel.successors.size = 0;
  channel.next.reset();
  channel.published.store(channel.state);
}

// ---- times ----

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
  while (!channel.successors.empty() && !channel.high &&
         (!channel.next ||
          channel.next->time_ns >= channel.successors.entries[0].profile->startNs())) {
    const Successors::Entry first = channel.successors.takeFirst();
    adopt(channel, *first.profile, first.serial);
    channel.published.store(channel.state);
  }
  const ChannelConfig& config = channel.config;
  const bool stepped = channel.state.pulses != 0;
  switch (actionOf(channel)) {
    case Action::kNothing:
      channel.due = kNever;
      return false;
    case Action::kFall:
      channel.due = channel.rose + config.step_high;
      return false;
    case Action::kPin:
      channel.due = channel.pin_due;
      return false;
    case Action::kTurn:
      channel.due = stepped ? channel.rose + config.dir_hold : 0;
      return false;
    case Action::kFinish:
      channel.due = channel.profile->endNs() + state_.slipped;
      return false;
    case Action::kRise:
      break;
  }
  Nanoseconds earliest = std::max(channel.state.ready, channel.turned + config.dir_setup);
  if (stepped) {
    const auto closest =
        static_cast<Nanoseconds>(kClosest * static_cast<double>(interval(channel)));
    earliest = std::max({earliest, channel.fell + config.step_low, channel.rose + closest});
  }
  const Nanoseconds planned = channel.next->time_ns + state_.slipped;
  channel.due = std::max(planned, earliest);
  if (earliest <= planned) return false;
  slide(earliest - planned);
  return true;
}

void PulseEngine::slide(Nanoseconds by) {
  state_.slipped += by;
  ++state_.slips;
  figures_.store(state_);
}

}  // namespace stepdriver::pulse
