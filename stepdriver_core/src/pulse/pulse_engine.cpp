#include "pulse/pulse_engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "engine_channel.h"
#include "engine_output.h"
#include "port/line_ports.h"
#include "stepdriver_core/error.h"

namespace stepdriver::pulse {

namespace {

// Whether the reason concerns all axes that share motors, and not just one axis's own inputs.
bool isOfAllAxes(EndReason reason) {
  switch (reason) {
    case EndReason::kEmergencyStop:
    case EndReason::kChipFault:
    case EndReason::kTooLate:
    case EndReason::kLineError:
      return true;
    default:
      return false;
  }
}

std::size_t sharedMotors(const std::vector<SharedAxes>& shared) {
  std::size_t motors = 0;
  for (const SharedAxes& axes : shared) motors += axes.channels.size();
  return motors;
}

// The lines and times of a shared motor, without what belongs to the axis whose chip drives it.
ChannelConfig motorOf(const ChannelConfig& axis) {
  ChannelConfig motor;
  motor.step = axis.step;
  motor.dir = axis.dir;
  motor.dir_steps = axis.dir_steps;
  motor.both_edges = axis.both_edges;
  motor.coils = axis.coils;
  motor.patterns = axis.patterns;
  motor.step_high = axis.step_high;
  motor.step_low = axis.step_low;
  motor.dir_setup = axis.dir_setup;
  motor.dir_hold = axis.dir_hold;
  return motor;
}

bool anyRamps(const std::vector<ChannelConfig>& channels, const SharedAxes& shared) {
  return std::any_of(shared.channels.begin(), shared.channels.end(),
                     [&](std::size_t axis) { return channels.at(axis).ramps_at_fault; });
}

// Axes that share motors need all of their chips to be in order.
std::vector<ChannelConfig> withSharedChips(std::vector<ChannelConfig> channels,
                                           const std::vector<SharedAxes>& shared) {
  const std::vector<ChannelConfig> given = channels;
  for (const SharedAxes& axes : shared) {
    Nanoseconds timeout = 0;
    for (const std::size_t axis : axes.channels) {
      timeout = std::max(timeout, given.at(axis).in_position_timeout);
    }
    const bool ramps = anyRamps(given, axes);
    for (const std::size_t axis : axes.channels) {
      channels[axis].in_position_timeout = timeout;
      channels[axis].ramps_at_fault = ramps;
      for (const std::size_t other : axes.channels) {
        if (other == axis) continue;
        MotorSignals& chip = channels[axis].twins.emplace_back();
        chip.fault = given[other].fault;
        chip.in_position = given[other].in_position;
      }
    }
  }
  return channels;
}

}  // namespace

inline void PulseEngine::changed(Channel& channel) {
  if (channel.changed) return;
  Channel* one = &channel;
  do {
    if (!one->changed) changed_.push_back(one);
    one->changed = true;
    one = one->next_of_kin;
  } while (one != &channel);
}

PulseEngine::PulseEngine(gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop,
                         const std::vector<SharedAxes>& shared)
    : PulseEngine(nullptr, lines, clock, channels, max_lateness, emergency_stop, shared) {}

PulseEngine::PulseEngine(StepPort& port, gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop,
                         const std::vector<SharedAxes>& shared)
    : PulseEngine(&port, lines, clock, channels, max_lateness, emergency_stop, shared) {}

PulseEngine::PulseEngine(StepPort* port, gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop,
                         const std::vector<SharedAxes>& shared)
    : lines_(lines),
      clock_(clock),
      own_port_(port != nullptr ? nullptr : makeLinePort(lines_, clock, lanesOf(channels, shared))),
      port_(port != nullptr ? *port : *own_port_),
      horizon_(port_.horizon()),
      max_lateness_(max_lateness),
      emergency_input_(emergency_stop),
      axes_(channels.size()),
      channels_(channels.size() + sharedMotors(shared)),
      dues_(channels_.size()) {
  const std::vector<ChannelConfig> configs = withSharedChips(channels, shared);
  std::size_t motor = axes_;
  for (const SharedAxes& axes : shared) motor = addShared(axes, configs, motor);
  for (std::size_t i = 0; i < axes_; ++i) {
    if (channels_[i]) continue;
    followers_.push_back(std::make_unique<Follower>());
    kins_.push_back(std::make_unique<Kin>());
    add(i, configs[i], *followers_.back(), *kins_.back());
    kins_.back()->axes = kins_.back()->all;
  }
  for (const auto& kin : kins_) {
    kin->guarded = std::any_of(kin->axes.begin(), kin->axes.end(),
                               [](const Channel* axis) { return !axis->guard.isIdle(); });
    for (Channel* axis : kin->axes) axis->reserve();
  }
  if (horizon_ != 0 && port_.lanes() > StepPort::kMostLanes) {
    throw Refused(fmt::format("a port with a horizon has {} lanes, but may have {} at most",
                              port_.lanes(), StepPort::kMostLanes));
  }
  port_.listen(*this);
  due_.reserve(channels_.size());
  changed_.reserve(channels_.size());
  readEmergencyStop();
}

std::vector<ChannelConfig> PulseEngine::lanesOf(std::vector<ChannelConfig> channels,
                                                const std::vector<SharedAxes>& shared) {
  const std::vector<ChannelConfig> given = channels;
  for (const SharedAxes& axes : shared) {
    const bool ramps = anyRamps(given, axes);
    for (const std::size_t axis : axes.channels) {
      channels.push_back(motorOf(given.at(axis)));
      channels.back().fault = given[axis].fault;
      channels.back().ramps_at_fault = ramps;
    }
  }
  return channels;
}

void PulseEngine::add(std::size_t index, const ChannelConfig& config, Follower& follower,
                      Kin& kin) {
  channels_.at(index) =
      std::make_unique<Channel>(index, config, follower, lines_, port_.lane(index));
  Channel& channel = *channels_[index];
  channel.kin = &kin;
  if (!kin.all.empty()) {
    channel.next_of_kin = kin.all.front();
    kin.all.back()->next_of_kin = &channel;
  }
  kin.all.push_back(&channel);
}

std::size_t PulseEngine::addShared(const SharedAxes& shared,
                                   const std::vector<ChannelConfig>& configs, std::size_t motor) {
  auto kin = std::make_unique<SumKin>(shared);
  for (std::size_t i = 0; i < shared.channels.size(); ++i) {
    const std::size_t axis = shared.channels[i];
    add(axis, configs.at(axis), kin->sum.axis(i), *kin);
  }
  kin->axes = kin->all;
  for (std::size_t i = 0; i < shared.channels.size(); ++i) {
    add(motor++, motorOf(configs[shared.channels[i]]), kin->sum.motor(i), *kin);
  }
  kins_.push_back(std::move(kin));
  return motor;
}

PulseEngine::~PulseEngine() = default;

std::size_t PulseEngine::channels() const { return axes_; }

ChannelState PulseEngine::channel(int index) const {
  return channels_.at(static_cast<std::size_t>(index))->published.load();
}

inline void PulseEngine::scheduleChanged() {
  for (Channel* channel : changed_) {
    channel->changed = false;
    schedule(*channel);
  }
  changed_.clear();
  if (outdated_) scheduleAll();
}

inline void PulseEngine::servePort(Nanoseconds now) {
  const std::uint64_t pulses = state_.pulses;
  port_.serve(now);
  if (state_.pulses != pulses) figures_.store(state_);
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
  if (dues_.earliest() <= now) horizon_ == 0 ? putSteps(now) : fillPort(now);
  if (port_.due() <= now || horizon_ != 0) servePort(now);
  scheduleChanged();
  if (horizon_ != 0) tellFollowed(now);
  Nanoseconds outputs_due = outputs_.empty() ? kNever : serveOutputs(now);
  if (std::min(dues_.earliest(), port_.due()) <= now) {
    finishDue(now);
    // What the end of a motion makes them do.
    if (!outputs_.empty()) outputs_due = serveOutputs(now);
  }
  if (heartbeat_ && now >= heartbeat_->due()) writeHeartbeat(now);
  serveStops();
  report();
  const Nanoseconds steps_due = std::min({dues_.earliest(), port_.due(), outputs_due});
  Nanoseconds due = std::min(steps_due, stops_.due([this] { return allSlow(); }));
  if (horizon_ != 0) due = std::min(due, tellDue());
  return heartbeat_ ? std::min(due, heartbeat_->due()) : due;
}

void PulseEngine::report() {
  if (!news_) return;
  news_ = false;
  if (listener_ != nullptr) listener_->onNews();
}

void PulseEngine::recordTo(PinRing& ring) {
  ring_ = &ring;
  port_.recordTo(ring);
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
  // An order may slide the timeline; then no step may go out at its old time.
  scheduleChanged();
}

void PulseEngine::takeCommand(const Command& command, Nanoseconds now) {
  if (command.kind == Command::Kind::kFollow) return followAll(command, now);
  if (command.kind == Command::Kind::kEndMarks) {
    EngineOutput& output = *outputs_[command.output];
    output.end();
    output.endCompare();
    return output.taken(command.serial);
  }
  if (command.kind == Command::Kind::kCompare) return takeCompare(*command.compare, now);
  Channel& channel = *channels_[static_cast<std::size_t>(command.channel)];
  if (command.kind == Command::Kind::kFault) {
    const bool ramps = channel.config.ramps_at_fault && channel.kin->isRunning();
    if (channel.kin->follows() && !ramps) end(channel, EndReason::kChipFault, now);
  } else if (command.kind == Command::Kind::kBlocked) {
    if (channel.kin->follows()) end(channel, EndReason::kBlocked, now);
  } else if (command.kind == Command::Kind::kRelease) {
    if (command.coils) setCurrent(channel, *command.coils, now);
    channel.release(command);
    for (const auto& output : outputs_) {
      // Its places were counts of the mode before.
      if (command.scale && output->channel() == command.channel) output->endCompare();
    }
    channel.state.accepted = command.serial;
  } else if (!channel.kin->follows() && !channel.kin->drains && !channel.guard.reserved()) {
    channel.guard.reserve();
    channel.state.accepted = command.serial;
  }
  channel.state.taken = command.serial;
  channel.publish();
  changed(channel);
}

void PulseEngine::setCurrent(Channel& channel, const CoilCurrent& current, Nanoseconds now) {
  const LineFailure failure = port_.setCurrent(channel.kin->motorOf(channel).index, current);
  if (failure.error != 0) fail(channel, failure, now);
}

void PulseEngine::followAll(const Command& command, Nanoseconds now) {
  bool may = true;
  for (std::size_t i = 0; i < command.follow_count; ++i) {
    may = may && mayFollow(command.follows[i], now);
  }
  for (std::size_t i = 0; i < command.marks_count; ++i) {
    may = may && outputs_[command.marks[i].output]->mayFollow(command.marks[i]);
  }
  for (std::size_t i = 0; i < command.marks_count; ++i) {
    EngineOutput& output = *outputs_[command.marks[i].output];
    if (may) output.follow(command.marks[i]);
    output.taken(command.marks[i].serial);
  }
  for (std::size_t i = 0; may && i < command.follow_count; ++i) {
    const Follow& order = command.follows[i];
    Channel& channel = *channels_[static_cast<std::size_t>(order.channel)];
    if (horizon_ != 0 && !channel.motion->follows()) {
      port_.begin(channel.index, {order.still, order.squares, order.is_square, order.until_block});
    }
    for (const auto& output : outputs_) {
      if (output->channel() != order.channel) continue;
      output->followAxis({order.profile, order.serial, order.settles}, channel.jointRests());
    }
    channel.follow(order, now);
    channel.state.accepted = order.serial;
    changed(channel);
  }
  // The sender sees all of them accepted at once: `follows` is no longer read.
  for (std::size_t i = command.follow_count; i-- > 0;) {
    const Follow& order = command.follows[i];
    Channel& channel = *channels_[static_cast<std::size_t>(order.channel)];
    channel.state.taken = order.serial;
    channel.publish();
  }
}

bool PulseEngine::mayFollow(const Follow& order, Nanoseconds now) const {
  const Channel& channel = *channels_[static_cast<std::size_t>(order.channel)];
  const Nanoseconds start = order.profile.startNs();
  const bool late = start < now - state_.slipped + horizon_ || start < channel.motion->madeUntil();
  return !late && !channel.kin->isReserved() && !channel.kin->drains &&
         order.continues == channel.motion->latest() && channel.motion->hasRoom(start) &&
         outputsHaveRoom(order) && order.faults == channel.state.faults() &&
         (emergencyStopped() ? order.slows && stops_.isRamping() : order.stops == stopsAsked());
}

// ---- inputs and emergency stops ----

std::uint64_t PulseEngine::emergencyStop() {
  const std::uint64_t asked = stops_.ask();
  clock_.wake();
  return asked;
}

std::uint64_t PulseEngine::stopAtOnce() {
  const std::uint64_t asked = stops_.askAtOnce();
  clock_.wake();
  return asked;
}

// Every motion has ended by now if its stop was requested before this pass; the pulses of that time
// may still be high. Or a ramp was to be made, and has ended.
void PulseEngine::serveStops() {
  const std::uint64_t asked = stopsAsked();
  if (asked == stopsServed()) return;
  for (const auto& channel : channels_) {
    if (channel->motion->follows() || channel->kin->isBusy()) return;
  }
  stops_.serve(asked);
  news_ = true;
}

void PulseEngine::inputsChanged() {
  inputs_changed_.store(true, std::memory_order_release);
  clock_.wake();
}

void PulseEngine::noteEdge(int input, bool level, Nanoseconds time) {
  for (const auto& channel : channels_) {
    const auto& block = channel->config.block;
    if (block && block->line == input && block->active == level) channel->guard.noteBlock(time);
  }
}

void PulseEngine::readEmergencyStop() {
  if (!emergency_input_) return;
  const int level = lines_.read(emergency_input_->line);
  stops_.readInput(level < 0 || (level != 0) == emergency_input_->active);
}

void PulseEngine::stopAll(Nanoseconds now) {
  endMarks();
  if (stops_.beginRamp(now)) news_ = true;
  if (stops_.mayRamp(now, [this] { return allSlow(); })) return;
  for (const auto& channel : channels_) {
    if (channel->motion->follows()) end(*channel, EndReason::kEmergencyStop, now);
  }
}

bool PulseEngine::allSlow() const {
  return std::all_of(channels_.begin(), channels_.end(), [](const auto& channel) {
    return !channel->motion->follows() || channel->slows;
  });
}

void PulseEngine::readInputs(Nanoseconds now) {
  readEmergencyStop();
  if (emergencyStopped()) stopAll(now);
  for (const auto& channel : channels_) {
    readFaults(*channel, now);
    if (channel->motion->next()) mayStep(*channel, now);
    if (channel->guard.settling()) {
      channel->guard.lookAgain(now);
      changed(*channel);
    }
  }
}

// While its pins change, and while it wakes, a chip's fault line means nothing.
void PulseEngine::readFaults(Channel& channel, Nanoseconds now) {
  if (channel.kin->isReserved() || now < channel.state.ready) return;
  for (std::size_t i = 0; i < channel.guard.motors(); ++i) {
    const auto objection = channel.guard.readFault(i);
    if (!objection) continue;
    const bool only_counts = objection->reason == EndReason::kChipFault &&
                             channel.config.ramps_at_fault && channel.kin->isRunning();
    if (!only_counts) {
      object(channel, *objection, now);
      continue;
    }
    channel.publish();
    news_ = true;
  }
}

inline bool PulseEngine::mayStep(Channel& channel, Nanoseconds now) {
  return !channel.kin->guarded || askGuards(channel, now);
}

// Each axis that the step moves must be allowed to move on.
bool PulseEngine::askGuards(Channel& channel, Nanoseconds now) {
  for (Channel* axis : channel.kin->axes) {
    if (axis->guard.unchecked() && now >= axis->state.ready) {
      axis->guard.check();
      readFaults(*axis, now);
    }
    if (!channel.motion->next()) return false;
    if (!axis->motion->follows() || horizon_ != 0) continue;
    const int direction = axis->motion->directionAt(channel.motion->next()->time_ns);
    if (const auto objection = axis->guard.mayStep(direction)) {
      object(*axis, *objection, now);
      return false;
    }
  }
  return true;
}

// ---- outputs ----

void PulseEngine::switchOutputs(const std::vector<OutputLine>& outputs) {
  for (const OutputLine& output : outputs) {
    outputs_.push_back(std::make_unique<EngineOutput>(output, lines_, clock_));
  }
}

// A motion that is ordered but hasn't begun may be from before: an order of the same turn.
void PulseEngine::takeCompare(const Compare& order, Nanoseconds now) {
  EngineOutput& output = *outputs_[order.output];
  const Channel& channel = *channels_[static_cast<std::size_t>(order.channel)];
  const Follower& motion = *channel.motion;
  const bool begins = motion.follows() && !motion.hasSuccessor() &&
                      now - state_.slipped < motion.profile().startNs();
  output.end();
  output.endCompare();
  if ((begins || !motion.follows()) && !emergencyStopped()) {
    output.compare(order, channel.jointRests());
    if (begins) {
      output.followAxis({motion.profile(), motion.following(), false}, channel.jointRests());
    }
  }
  output.taken(order.serial);
}

bool PulseEngine::outputsHaveRoom(const Follow& order) const {
  return std::all_of(outputs_.begin(), outputs_.end(), [&](const auto& output) {
    return output->channel() != order.channel || output->hasRoom(order.profile.startNs());
  });
}

OutputLineState PulseEngine::output(std::size_t index) const { return outputs_.at(index)->state(); }

std::size_t PulseEngine::outputs() const { return outputs_.size(); }

// A stop may have come since this pass has begun. @return when it must be called again
Nanoseconds PulseEngine::serveOutputs(Nanoseconds now) {
  if (emergencyStopped()) endMarks();
  Nanoseconds due = kNever;
  for (const auto& output : outputs_) {
    if (output->serve(now, state_.slipped, ring_)) news_ = true;
    due = std::min(due, output->due(state_.slipped));
  }
  return due;
}

void PulseEngine::endMarks() {
  for (const auto& output : outputs_) {
    if (output->end()) news_ = true;
    if (output->mute()) news_ = true;
  }
}

void PulseEngine::endMarksOf(std::uint64_t group) {
  for (const auto& output : outputs_) {
    if (output->group() == group && output->end()) news_ = true;
  }
}

// ---- steps ----

inline void PulseEngine::collectDue(Nanoseconds now) {
  due_.clear();
  dues_.collect(now, due_);
}

// A delay in a pulse, or in a write, puts off the next step: then that one isn't late, but has come
// too long after the last one. Returns whether the timeline slid, so that other channels are due
// now.
[[gnu::always_inline]] inline bool PulseEngine::meetLateness(Nanoseconds now) {
  Nanoseconds excess = 0;
  for (const std::size_t index : due_) {
    Channel& channel = *channels_[index];
    if (!channel.canStep()) continue;
    const Nanoseconds late = now - channel.at;
    const Nanoseconds motion_now = now - state_.slipped;
    const Nanoseconds lag = motion_now - channel.motion->next()->time_ns;
    const Nanoseconds worst = std::max({late, channel.overdue(now), channel.behind});
    if (lag <= 0 && worst <= max_lateness_) continue;
    channel.late = std::max({channel.late, late, lag});
    if (worst > max_lateness_ && channel.motion->isFast(motion_now - late)) {
      for (Channel* axis : channel.kin->axes) axis->state.end_lateness = worst;
      end(channel, EndReason::kTooLate, now);
      continue;
    }
    excess = std::max(excess, channel.motion->excess(motion_now));
  }
  if (excess == 0) return false;
  slide(excess);
  scheduleAll();
  return true;
}

void PulseEngine::putSteps(Nanoseconds now) {
  collectDue(now);
  if (meetLateness(now)) collectDue(now);
  for (const std::size_t index : due_) {
    Channel& channel = *channels_[index];
    if (!channel.canStep() || !mayStep(channel, now)) continue;
    StepPort::Step step{index, channel.motion->next()->direction, channel.at, channel.state.still};
    if (horizon_ == 0) {
      port_.put(step);
    } else {
      putAhead(channel, step);
    }
  }
  // Reading the switches took time, and a stop may have come meanwhile: it takes the steps back.
  if (emergencyStopped()) stopAll(now);
}

void PulseEngine::finishDue(Nanoseconds now) {
  collectDue(now);
  if (port_.due() <= now) servePort(now);
  for (const std::size_t index : due_) {
    if (channels_[index]->canFinish()) finish(*channels_[index], now);
  }
  scheduleChanged();
}

// ---- what the port tells ----

void PulseEngine::played(std::size_t index, int direction, MotorSet still, Nanoseconds time) {
  Channel& channel = *channels_[index];
  changed(channel);
  if (horizon_ == 0) {
    channel.behind = channel.overdue(time);
    Follower& motion = *channel.motion;
    // The write itself has taken time.
    if (motion.mayBeLate()) slide(motion.excess(time - state_.slipped));
    motion.advance();
  } else {
    channel.state.still |= still;
    channel.is_fast = channel.motion->isFastAt(time - channel.state.rose);
  }
  ++state_.pulses;
  state_.worst_lateness = std::max(state_.worst_lateness, channel.late);
  lateness_.add(time, channel.late);
  channel.late = 0;
  channel.kin->stepped(channel, {direction, still, time});
  if (horizon_ != 0) closed(channel, 1);
}

// Puts all that is due: no channel is further ahead than another one when the timeline slides,
// which moves only what hasn't been put.
void PulseEngine::fillPort(Nanoseconds now) {
  bool fills = true;
  while (fills && dues_.earliest() <= now) {
    const std::uint64_t before = puts_;
    putSteps(now);
    scheduleChanged();
    fills = puts_ != before;
  }
}

// The timeline continues from here, whenever the port plays the step.
void PulseEngine::putAhead(Channel& channel, StepPort::Step& step) {
  for (const Channel* axis : channel.kin->axes) {
    if (!axis->motion->follows()) continue;
    const int direction = axis->motion->directionAt(channel.motion->next()->time_ns);
    if (direction > 0) step.forward |= StepPort::laneBit(axis->index);
    if (direction < 0) step.backward |= StepPort::laneBit(axis->index);
  }
  port_.put(step);
  ++channel.put;
  ++puts_;
  ++channel.kin->open;
  channel.motion->advance();
  changed(channel);
}

// The timeline is ahead of what is played.
void PulseEngine::tellFollowed(Nanoseconds now) {
  for (std::size_t i = 0; i < axes_; ++i) {
    Channel& axis = *channels_[i];
    if (axis.tellAt() == kNever || axis.tellAt() + state_.slipped > now) continue;
    axis.tell(now - state_.slipped);
    axis.publish();
  }
}

Nanoseconds PulseEngine::tellDue() const {
  Nanoseconds due = kNever;
  for (std::size_t i = 0; i < axes_; ++i) {
    const Nanoseconds at = channels_[i]->tellAt();
    if (at != kNever) due = std::min(due, at + state_.slipped);
  }
  return due;
}

void PulseEngine::closed(Channel& channel, std::size_t steps) {
  channel.over += steps;
  channel.kin->open -= steps;
  if (channel.kin->open == 0 && channel.kin->drains) concludeEnd(*channel.kin);
}

void PulseEngine::ready(std::size_t channel) { changed(*channels_[channel]); }

void PulseEngine::givenBack(std::size_t channel, std::size_t steps) {
  changed(*channels_[channel]);
  channels_[channel]->kin->unmade = true;
  closed(*channels_[channel], steps);
}

void PulseEngine::stopped(std::size_t channel, const StepPort::Stop& stop) {
  Channel& stepped = *channels_[channel];
  stepped.state.still |= stop.still;
  Channel& axis = *stepped.kin->axisOf(*channels_[stop.lane]);
  if (stop.reason == EndReason::kChipFault) axis.guard.noteFault(stop.motor);
  object(axis, {stop.reason, stop.failure}, clock_.now());
}

// Like a stop at a speed that the motor can't stop from: its position isn't valid afterwards.
void PulseEngine::doubtful(std::size_t channel) {
  channels_[channel]->kin->unmade = true;
  channels_[channel]->is_fast = true;
}

void PulseEngine::failed(std::size_t channel, const LineFailure& failure, Nanoseconds now) {
  fail(*channels_[channel], failure, now);
}

void PulseEngine::writeHeartbeat(Nanoseconds now) {
  const gpio::LineWrite write = heartbeat_->next();
  const int error = lines_.write(&write, 1);
  if (error == 0 && ring_ != nullptr) ring_->add(write.output, write.level, clock_.now());
  if (!heartbeat_->done(error == 0, now)) return;
  // Whatever watches the line now takes the motors' power away.
  for (const auto& channel : channels_) fail(*channel, {error, write.output}, now);
  scheduleChanged();
}

void PulseEngine::finish(Channel& channel, Nanoseconds now) {
  changed(channel);
  // Another channel may have changed what is left to be done before it.
  if (endOf(channel) > now) return;
  if (channel.motion->hasSuccessor()) {
    channel.motion->takeOver();
    channel.adopted(horizon_ == 0);
    return channel.publish();
  }
  if (!channel.motion->settles()) return end(channel, EndReason::kDone, now);
  switch (channel.guard.settle(now)) {
    case AxisGuard::Settling::kWaits:
      return;
    case AxisGuard::Settling::kDone:
      return end(channel, EndReason::kDone, now);
    case AxisGuard::Settling::kTooLong:
      return end(channel, EndReason::kNotInPosition, now);
    case AxisGuard::Settling::kFailed:
      return fail(channel, channel.guard.failure(), now);
  }
}

// ---- ends ----

void PulseEngine::object(Channel& channel, const Objection& objection, Nanoseconds now) {
  if (objection.reason == EndReason::kLineError) return fail(channel, objection.failure, now);
  end(channel, objection.reason, now);
}

void PulseEngine::fail(Channel& channel, const LineFailure& failure, Nanoseconds now) {
  for (Channel* axis : channel.kin->axes) {
    axis->state.failure = failure;
    ++axis->state.line_errors;
  }
  end(channel, EndReason::kLineError, now);
}

void PulseEngine::end(Channel& channel, EndReason reason, Nanoseconds now) {
  if (reason != EndReason::kDone) return endEarly(channel, reason, now);
  channel.motion->finish();
  endOne(channel, reason, false, now);
}

// What ends one of several axes that share motors early ends all of them, and each one's group.
void PulseEngine::endEarly(Channel& channel, EndReason reason, Nanoseconds now) {
  Kin& kin = *channel.kin;
  if (kin.ends) return;
  kin.ends = true;
  const bool abrupt = horizon_ == 0 && channel.motion->isFast(now - state_.slipped);
  kin.drains = kin.open != 0;
  for (const Channel* one : kin.all) kin.unmade = kin.unmade || one->motion->next().has_value();
  // Before others can see that the motion has ended: then no mark comes.
  for (const Channel* axis : kin.axes) {
    if (axis->motion->follows() && axis->group != 0) endMarksOf(axis->group);
  }
  for (Channel* axis : kin.axes) {
    const bool moved = axis->motion->follows();
    if (!moved && axis != &channel) {
      changed(*axis);
      continue;
    }
    endOne(*axis, axis == &channel || isOfAllAxes(reason) ? reason : EndReason::kCompanion, abrupt,
           now);
    axis->ended_early = moved;
    if (!moved || axis->group == 0) continue;
    for (const auto& other : channels_) {
      if (other->motion->follows() && other->group == axis->group && other->kin != &kin) {
        end(*other, EndReason::kCompanion, now);
      }
    }
  }
  channel.motion->halt();
  kin.halted();
  for (const Channel* one : kin.all) port_.takeBack(one->index);
  if (horizon_ != 0 && !kin.drains) concludeEnd(kin);
  kin.ends = false;
  news_ = true;
}

// Every step that was handed over has been played or given back: the motors stand at their counts,
// and the last steps that were played tell whether they have stopped from a high speed.
void PulseEngine::concludeEnd(Kin& kin) {
  kin.drains = false;
  bool abrupt = false;
  for (Channel* channel : kin.all) {
    channel->motion->rescale(channel->state.count);
    abrupt = abrupt || (kin.unmade && channel->is_fast);
    channel->is_fast = false;
  }
  kin.unmade = false;
  for (Channel* axis : kin.axes) {
    axis->state.end_abrupt = axis->state.end_abrupt || (abrupt && axis->ended_early);
    axis->ended_early = false;
    axis->motion->halt();
  }
  kin.halted();
  for (Channel* channel : kin.all) {
    channel->state.rests_at = channel->motion->restsAt();
    channel->publish();
    changed(*channel);
  }
  news_ = true;
}

void PulseEngine::endOne(Channel& channel, EndReason reason, bool abrupt, Nanoseconds now) {
  const bool done = reason == EndReason::kDone;
  for (const auto& output : outputs_) {
    if (output->channel() != static_cast<int>(channel.index)) continue;
    output->axisEnded(now - state_.slipped, channel.joint(done), done && channel.arrives);
  }
  channel.endMotion(reason, abrupt, now - state_.slipped);
  news_ = true;
  changed(channel);
}

// ---- times ----

void PulseEngine::scheduleAll() {
  // A slide moves everything scheduled before it; no second slide follows for the same reason.
  do {
    outdated_ = false;
    for (const auto& channel : channels_) schedule(*channel);
  } while (outdated_);
}

inline void PulseEngine::aim(Channel& channel, int direction) {
  if (channel.lane.aim != direction) port_.aim(channel.index, direction);
}

// The earliest time at which the next step may follow the last one.
inline Nanoseconds PulseEngine::closestStep(const Channel& channel) {
  return channel.motion->catchesUp() ? channel.lane.closest
                                     : channel.lane.last + channel.motion->closest();
}

// The next step can't go out before `earliest`.
inline void PulseEngine::slideFor(const Channel& channel, Nanoseconds earliest) {
  const Nanoseconds motion_then = earliest - state_.slipped;
  if (motion_then > channel.motion->next()->time_ns) slideAt(channel, motion_then);
}

inline void PulseEngine::scheduleStep(Channel& channel) {
  Nanoseconds earliest = std::max(channel.state.ready, channel.lane.takes);
  if (channel.lane.stepped) earliest = std::max(earliest, closestStep(channel));
  channel.at = std::max(channel.motion->next()->time_ns + state_.slipped, earliest);
  // A chip that wakes has no fault output yet.
  dues_.set(channel.index, std::max(channel.at - horizon_, channel.state.ready));
  slideFor(channel, earliest);
}

void PulseEngine::schedule(Channel& channel) {
  Follower& motion = *channel.motion;
  while (!channel.lane.busy && motion.isReplaced()) {
    if (!motion.takeOver()) {
      aim(channel, 0);
      dues_.set(channel.index, kNever);
      return;
    }
    channel.adopted(horizon_ == 0);
    channel.publish();
  }
  const auto& next = motion.next();
  if (channel.lane.busy) {
    dues_.set(channel.index, kNever);
    // The time that a slow write takes from the next interval belongs to the same slip as its
    // lateness.
    if (next && !motion.isReplaced()) slideFor(channel, closestStep(channel));
  } else if (!next) {
    aim(channel, 0);
    if (horizon_ != 0 && motion.follows()) channel.noteLastSteps();
    dues_.set(channel.index, motion.follows() ? endOf(channel) : kNever);
  } else if (channel.lane.accepts(next->direction)) {
    aim(channel, 0);
    scheduleStep(channel);
  } else {
    aim(channel, next->direction);
    dues_.set(channel.index, kNever);
  }
}

Nanoseconds PulseEngine::endOf(const Channel& channel) const {
  const auto end = channel.motion->endsAt();
  if (!end) return kNever;
  // The steps of a successor are put ahead of time.
  if (channel.motion->hasSuccessor()) return *end + state_.slipped - horizon_;
  // The last pulses must be over, also those of shared motors.
  if (horizon_ == 0 ? channel.kin->isBusy() : !channel.isPlayed()) return kNever;
  return std::max(*end + state_.slipped, channel.guard.lookAt());
}

// The next step goes out at a motion time after its own.
void PulseEngine::slideAt(const Channel& channel, Nanoseconds motion_then) {
  const Follower& motion = *channel.motion;
  const Nanoseconds angle = motion.catchesUp() ? motion.angleAsTime(motion_then) : 0;
  slide(motion_then - motion.next()->time_ns - angle);
}

void PulseEngine::slide(Nanoseconds by) {
  if (by <= 0) return;
  state_.slipped += by;
  outdated_ = true;
  if (!slid_) ++state_.slips;
  slid_ = true;
  figures_.store(state_);
}

}  // namespace stepdriver::pulse
