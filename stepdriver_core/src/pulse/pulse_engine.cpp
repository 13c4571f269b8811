#include "pulse/pulse_engine.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "engine_channel.h"
#include "shared_motors.h"

namespace stepdriver::pulse {

using Action = EngineChannel::Action;

namespace {

// How often the in-position output is read at the end of a motion, if no edge is reported.
constexpr Nanoseconds kLookPeriod = 1'000'000;

// Of axes that share motors: whether it concerns all of them, and not just one axis's own inputs.
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

}  // namespace

inline void PulseEngine::changed(Channel& channel) {
  if (channel.changed) return;
  channel.changed = true;
  changed_.push_back(&channel);
  if (channel.shared != nullptr) changedTogether(channel);
}

PulseEngine::PulseEngine(gpio::Lines& lines, Clock& clock,
                         const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
                         std::optional<Signal> emergency_stop,
                         const std::vector<SharedAxes>& shared)
    : lines_(lines),
      clock_(clock),
      max_lateness_(max_lateness),
      emergency_input_(emergency_stop),
      axes_(channels.size()),
      channels_(channels.size() + sharedMotors(shared)),
      dues_(channels_.size()) {
  for (std::size_t i = 0; i < channels_.size(); ++i) channels_[i].index = i;
  for (std::size_t i = 0; i < axes_; ++i) channels_[i].config = channels[i];
  std::size_t motor = axes_;
  for (const SharedAxes& axes : shared) {
    std::vector<Channel*> axis_channels;
    std::vector<Channel*> motor_channels;
    for (const std::size_t axis : axes.channels) {
      axis_channels.push_back(&channels_.at(axis));
      motor_channels.push_back(&channels_[motor++]);
    }
    shared_.push_back(
        std::make_unique<SharedMotors>(axes, std::move(axis_channels), std::move(motor_channels)));
  }
  std::size_t motors = 0;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    channels_[i].pulse_line = channels_[i].stepOf(0, channels_[i].direction);
    channels_[i].all_motors = static_cast<MotorSet>(motorBit(channels_[i].motors()) - 1);
    motors += channels_[i].motors();
  }
  due_.reserve(channels_.size());
  changed_.reserve(channels_.size());
  writes_.reserve(motors);
  writers_.reserve(motors);
  errors_.resize(motors);
  readEmergencyStop();
}

PulseEngine::~PulseEngine() = default;

std::size_t PulseEngine::channels() const { return axes_; }

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
  writeHeartbeat(now);
  scheduleChanged();
  serveStops();
  tell();
  const Nanoseconds due = std::min(dues_.earliest(), rampDue());
  return heartbeat_ ? std::min(due, heartbeat_->due()) : due;
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
  // An order may slide the timeline; then no step may go out at its old time.
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
  // The sender sees all of them accepted at once: `follows` is no longer read.
  for (std::size_t i = command.follow_count; i-- > 0;) {
    const Follow& order = command.follows[i];
    Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
    channel.state.taken = order.serial;
    channel.publish();
  }
}

bool PulseEngine::mayFollow(const Follow& order, Nanoseconds now) const {
  const Channel& channel = channels_[static_cast<std::size_t>(order.channel)];
  const Nanoseconds start = order.profile.startNs();
  const bool late = start < now - state_.slipped || start < channel.madeUntil();
  return !late && !channel.isReserved() && order.continues == channel.latest() &&
         channel.successors.hasRoom(start) && order.faults == channel.state.faults() &&
         (emergencyStopped() ? order.slows && isRamping() : order.stops == stopsAsked());
}

// ---- inputs and emergency stops ----

std::uint64_t PulseEngine::emergencyStop() {
  const std::uint64_t asked = stops_.ask();
  clock_.wake();
  return asked;
}

std::uint64_t PulseEngine::stopAtOnce() {
  const std::uint64_t asked = stops_.ask();
  at_once_.store(asked, std::memory_order_release);
  clock_.wake();
  return asked;
}

// Every motion has ended by now if its stop was requested before this pass; the pulses of that time
// may still be high. Or a ramp was to be made, and has ended.
void PulseEngine::serveStops() {
  const std::uint64_t asked = stopsAsked();
  if (asked == stopsServed()) return;
  for (const Channel& channel : channels_) {
    if (channel.high || channel.follows()) return;
  }
  stops_.serve(asked);
  news_ = true;
}

void PulseEngine::inputsChanged() {
  inputs_changed_.store(true, std::memory_order_release);
  clock_.wake();
}

void PulseEngine::readEmergencyStop() {
  if (!emergency_input_) return;
  const int level = readLine(emergency_input_->line);
  const bool active = level < 0 || (level != 0) == emergency_input_->active;
  // If it is still active after a clear, that is another stop.
  if (active && !(emergency_input_active_ && emergencyStopped())) {
    const bool ramps = isRamping();
    input_stops_.fetch_add(1, std::memory_order_release);
    stops_.ask();
    if (ramps) ++ramps_until_stop_;
  }
  emergency_input_active_ = active;
}

void PulseEngine::stopAll(Nanoseconds now) {
  if (mayRamp(now)) return;
  for (Channel& channel : channels_) {
    if (channel.follows()) end(channel, EndReason::kEmergencyStop, now);
  }
}

bool PulseEngine::isRamping() const {
  return stopsRamping() > stopsServed() && ramps_until_stop_ == stopsAsked() &&
         at_once_.load(std::memory_order_acquire) <= stopsServed();
}

bool PulseEngine::allSlow() const {
  return std::all_of(channels_.begin(), channels_.end(),
                     [](const Channel& channel) { return !channel.follows() || channel.slows; });
}

// Begins the ramp of a new stop. Returns whether the motions may decelerate.
bool PulseEngine::mayRamp(Nanoseconds now) {
  if (longest_ramp_ == 0 || stopsAsked() == stopsServed()) return false;
  if (stopsRamping() <= stopsServed()) {
    ramps_until_stop_ = stopsAsked();
    ramp_began_ = now;
    ramping_.store(ramps_until_stop_, std::memory_order_release);
    news_ = true;
  }
  return isRamping() && now < ramp_began_ + longest_ramp_ &&
         (now < ramp_began_ + kRampBegins || allSlow());
}

// When the ramp must be looked at again.
Nanoseconds PulseEngine::rampDue() const {
  if (longest_ramp_ == 0 || !isRamping()) return kNever;
  return ramp_began_ + (allSlow() ? longest_ramp_ : std::min(kRampBegins, longest_ramp_));
}

void PulseEngine::readInputs(Nanoseconds now) {
  readEmergencyStop();
  if (emergencyStopped()) stopAll(now);
  for (Channel& channel : channels_) {
    readFault(channel, now);
    if (channel.next) mayStep(channel, now);
    if (channel.settling) {
      channel.look_at = now;
      changed(channel);
    }
  }
}

void PulseEngine::readFault(Channel& channel, Nanoseconds now) {
  // While its pins change, and while it wakes, a chip's fault line means nothing.
  if (channel.isReserved() || now < channel.state.ready) return;
  for (std::size_t i = 0; i < channel.motors(); ++i) {
    const auto& fault = channel.motor(i).fault;
    if (!fault) continue;
    const int level = readLine(fault->line);
    const bool faulty = level < 0 || (level != 0) == fault->active;
    const bool was_faulty = (channel.faulty & motorBit(i)) != 0;
    if (faulty == was_faulty) continue;
    channel.faulty ^= motorBit(i);
    if (!faulty) continue;
    if (level < 0) {
      fail(channel, {-level, fault->line, true}, now);
      continue;
    }
    ++channel.state.chip_faults;
    channel.state.chip_at_fault = static_cast<std::uint8_t>(i);
    if (channel.config.ramps_at_fault && channel.isRunning()) {
      channel.publish();
      news_ = true;
    } else {
      end(channel, EndReason::kChipFault, now);
    }
  }
}

bool PulseEngine::mayStep(Channel& channel, Nanoseconds now) {
  // A chip may wake with a fault that it had before: its line doesn't change then.
  if (channel.unchecked && now >= channel.state.ready) {
    channel.unchecked = false;
    readFault(channel, now);
    if (!channel.next) return false;
  }
  if (!channel.isAlone()) return mayStepTogether(channel, now);
  if (channel.shared != nullptr) return mayStepShared(channel, now);
  const auto& endstop =
      channel.next->direction > 0 ? channel.config.endstop_max : channel.config.endstop_min;
  return !endstop || mayStepOn(channel, 0, now);
}

bool PulseEngine::mayStepTogether(Channel& channel, Nanoseconds now) {
  for (std::size_t i = 0; i < channel.motors(); ++i) {
    if (!channel.isStill(i) && !mayStepOn(channel, i, now)) return false;
  }
  if (channel.squares && channel.state.still != 0 && channel.wouldSkew()) {
    end(channel, EndReason::kSkewed, now);
    return false;
  }
  return true;
}

// Each axis that the step moves must be allowed to move on: its direction is that of its own
// profile, whichever way the motor turns.
bool PulseEngine::mayStepShared(Channel& motor, Nanoseconds now) {
  for (Channel* axis : motor.shared->axes()) {
    if (axis->unchecked && now >= axis->state.ready) {
      axis->unchecked = false;
      readFault(*axis, now);
    }
    if (!motor.next) return false;
    const bool has_switch = axis->config.endstop_min || axis->config.endstop_max;
    if (!axis->follows() || !has_switch) continue;
    const double velocity = axis->profile.stateAt(motor.next->time_ns).velocity;
    if (velocity != 0.0 && !mayStepTowards(*axis, 0, velocity > 0.0, now)) return false;
  }
  return true;
}

// Whether the endstop of a motor allows a step of the axis.
bool PulseEngine::mayStepOn(Channel& channel, std::size_t motor, Nanoseconds now) {
  return mayStepTowards(channel, motor, channel.next->direction > 0, now);
}

bool PulseEngine::mayStepTowards(Channel& channel, std::size_t motor, bool forward,
                                 Nanoseconds now) {
  const MotorSignals& signals = channel.motor(motor);
  const auto& endstop = forward ? signals.endstop_max : signals.endstop_min;
  if (!endstop) return true;
  const int level = readLine(endstop->line);
  if (level < 0) {
    fail(channel, {-level, endstop->line, true}, now);
    return false;
  }
  if ((level != 0) != endstop->active) return true;
  if (channel.squares) channel.state.still |= motorBit(motor);
  if (channel.squares && channel.state.still != channel.all_motors) return true;
  end(channel, forward ? EndReason::kEndstopMax : EndReason::kEndstopMin, now);
  return false;
}

// ---- lines ----

int PulseEngine::writeLines(const gpio::LineWrite* writes, std::size_t count) {
  output_at_work_.store(writes->output, std::memory_order_relaxed);
  input_at_work_.store(-1, std::memory_order_relaxed);
  return lines_.write(writes, count);
}

int PulseEngine::readLine(int input) {
  input_at_work_.store(input, std::memory_order_relaxed);
  return lines_.read(input);
}

LineFailure PulseEngine::lineAtWork() const {
  const int input = input_at_work_.load(std::memory_order_relaxed);
  if (input >= 0) return {ETIMEDOUT, input, true};
  return {ETIMEDOUT, output_at_work_.load(std::memory_order_relaxed)};
}

// ---- edges ----

void PulseEngine::collectDue(Nanoseconds now) {
  due_.clear();
  dues_.collect(now, due_);
}

// A delay in a pulse, or in a write, puts off the next step: then that one isn't late, but has come
// too long after the last one. Returns whether the timeline slid, so that other channels are due
// now.
bool PulseEngine::meetLateness(Nanoseconds now) {
  Nanoseconds excess = 0;
  for (const std::size_t index : due_) {
    Channel& channel = channels_[index];
    if (channel.action() != Action::kRise) continue;
    const Nanoseconds late = now - dues_[index];
    const Nanoseconds motion_now = now - state_.slipped;
    const Nanoseconds lag = motion_now - channel.next->time_ns;
    const Nanoseconds worst = std::max({late, channel.overdue(now), channel.behind});
    if (lag <= 0 && worst <= max_lateness_) continue;
    channel.late = std::max({channel.late, late, lag});
    const bool too_late =
        worst > max_lateness_ &&
        (channel.shared != nullptr ? channel.shared->isFast(motion_now - late) : channel.isFast());
    if (too_late) {
      channel.state.end_lateness = worst;
      end(channel, EndReason::kTooLate, now);
      continue;
    }
    excess = std::max(excess, lag - absorbed(channel, motion_now));
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
    if (!channel.isAlone()) {
      addPulses(channel, fall);
      continue;
    }
    const Signal& step = channel.pulse_line;
    // Member by member: copying a complete pair would make the processor wait.
    gpio::LineWrite& write = writes_.emplace_back();
    write.output = step.line;
    write.level = step.active != (fall || channel.toggled != 0);
    writers_.push_back(&channel);
  }
  // Reading the switches took time, and a stop may have come meanwhile; and the end of one channel
  // may have ended others.
  if (emergencyStopped()) stopAll(now);
  if (news_) dropEnded();  // an end is news
  if (writes_.empty()) return;
  const std::uint64_t pulses = state_.pulses;
  const int error = writeLines(writes_.data(), writes_.size());
  if (error != 0) {
    writeOneByOne(error, now);
  } else {
    const Nanoseconds done = clock_.now();
    for (std::size_t i = 0; i < writers_.size(); ++i) {
      record(writes_[i], done);
      if (i == 0 || writers_[i] != writers_[i - 1]) written(*writers_[i], done);
    }
  }
  if (state_.pulses != pulses) figures_.store(state_);
}

// The motors of an axis follow each other in the write. A pulse ends on each motor on which it has
// begun, also if one has become still meanwhile.
void PulseEngine::addPulses(Channel& channel, bool fall) {
  if (!fall) channel.pulsed = channel.all_motors & static_cast<MotorSet>(~channel.state.still);
  for (std::size_t i = 0; i < channel.motors(); ++i) {
    if ((channel.pulsed & motorBit(i)) == 0) continue;
    const Signal& step = channel.stepOf(i, channel.direction);
    const bool toggled = (channel.toggled & motorBit(i)) != 0;
    writes_.push_back({step.line, step.active != (fall || toggled)});
    writers_.push_back(&channel);
  }
}

void PulseEngine::record(const gpio::LineWrite& write, Nanoseconds now) {
  if (ring_ != nullptr) ring_->add(write.output, write.level, now);
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

// Writing one by one shows whose line fails. Lines that the failed write has already set keep their
// level. The count is that of the first motor in the write, even if another's line fails.
void PulseEngine::writeOneByOne(int error, Nanoseconds now) {
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    Channel& channel = *writers_[i];
    errors_[i] = writers_.size() > 1 ? writeLines(&writes_[i], 1) : error;
    const Nanoseconds done = clock_.now();
    if (errors_[i] == 0) record(writes_[i], done);
    if (i > 0 && writers_[i] == writers_[i - 1]) continue;
    if (errors_[i] == 0) {
      written(channel, done);
    } else {
      // The edge may have happened.
      if (channel.high || channel.config.both_edges) channel.fell = done;
      if (!channel.high) channel.rose = done;
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
  if (channel.config.both_edges) {
    channel.toggled ^= channel.pulsed;
    channel.fell = now;
  } else {
    channel.high = !channel.high;
    if (!channel.high) {
      channel.fell = now;
      return;
    }
  }
  channel.behind = channel.overdue(now);
  channel.rose = now;
  if (channel.fullStep() > 0) {
    // The write itself has taken time.
    const Nanoseconds motion_now = now - state_.slipped;
    const Nanoseconds lag = motion_now - channel.next->time_ns;
    const Nanoseconds excess = lag > 0 ? lag - absorbed(channel, motion_now) : 0;
    if (excess > 0) {
      slide(excess);
      slid_in_write_ = true;
    }
  }
  ++state_.pulses;
  state_.worst_lateness = std::max(state_.worst_lateness, channel.late);
  lateness_.add(now, channel.late);
  channel.countStep();
  if (channel.shared != nullptr) channel.shared->stepped(channel);
}

void PulseEngine::writeOthers(Nanoseconds now) {
  for (const std::size_t index : due_) {
    Channel& channel = channels_[index];
    switch (channel.action()) {
      case Action::kTurn:
        turn(channel, now);
        break;
      case Action::kFinish:
        finish(channel, now);
        break;
      default:
        break;
    }
  }
}

void PulseEngine::writeHeartbeat(Nanoseconds now) {
  if (!heartbeat_ || now < heartbeat_->due()) return;
  const gpio::LineWrite write = heartbeat_->next();
  const int error = writeLines(&write, 1);
  if (error == 0) record(write, clock_.now());
  if (!heartbeat_->done(error == 0, now)) return;
  // Whatever watches the line now takes the motors' power away.
  for (Channel& channel : channels_) fail(channel, {error, write.output}, now);
}

void PulseEngine::turn(Channel& channel, Nanoseconds now) {
  if (channel.config.dir_steps) {
    channel.turned = clock_.now();  // the last pulse may have ended in this pass
    channel.direction = channel.next->direction;
    channel.pulse_line = channel.stepOf(0, channel.direction);
    return changed(channel);
  }
  const bool forward = channel.next->direction > 0;
  std::array<gpio::LineWrite, kMostMotors> writes{};
  for (std::size_t i = 0; i < channel.motors(); ++i) {
    const Signal& dir = channel.motor(i).dir;
    writes[i] = {dir.line, forward ? dir.active : !dir.active};
  }
  if (const int error = writeLines(writes.data(), channel.motors())) {
    // Writing one by one shows whose line fails.
    std::size_t failing = 0;
    while (failing + 1 < channel.motors() && writeLines(&writes[failing], 1) == 0) ++failing;
    fail(channel, {error, writes[failing].output}, now);
    return;
  }
  channel.turned = clock_.now();
  for (std::size_t i = 0; i < channel.motors(); ++i) record(writes[i], channel.turned);
  channel.direction = channel.next->direction;
  changed(channel);
}

void PulseEngine::finish(Channel& channel, Nanoseconds now) {
  if (channel.shared != nullptr) {
    changed(channel);
    // Another axis may have changed what is left to be done before it.
    if (!channel.shared->dueOf(channel)) return;
    if (!channel.successors.empty()) {
      channel.shared->takeOver(channel);
      return channel.publish();
    }
  }
  if (!channel.settles) return end(channel, EndReason::kDone, now);
  std::size_t unsettled = channel.motors();
  for (std::size_t i = channel.motors(); i-- > 0;) {
    const auto& in_position = channel.motor(i).in_position;
    if (!in_position) continue;
    const int level = readLine(in_position->line);
    if (level < 0) return fail(channel, {-level, in_position->line, true}, now);
    if ((level != 0) != in_position->active) unsettled = i;
  }
  if (unsettled == channel.motors()) return end(channel, EndReason::kDone, now);
  channel.state.unsettled = static_cast<std::uint8_t>(unsettled);
  if (!channel.settling) channel.settling_since = now;
  channel.settling = true;
  const Nanoseconds latest = channel.settling_since + channel.config.in_position_timeout;
  if (now >= latest) {
    channel.state.waited = now - channel.settling_since;
    return end(channel, EndReason::kNotInPosition, now);
  }
  channel.look_at = std::min(now + kLookPeriod, latest);
  changed(channel);
}

void PulseEngine::fail(Channel& channel, const LineFailure& failure, Nanoseconds now) {
  if (channel.shared != nullptr) {
    for (Channel* axis : channel.shared->axes()) {
      axis->state.failure = failure;
      ++axis->state.line_errors;
    }
  } else {
    channel.state.failure = failure;
    ++channel.state.line_errors;
  }
  end(channel, EndReason::kLineError, now);
}

void PulseEngine::end(Channel& channel, EndReason reason, Nanoseconds now) {
  if (channel.shared != nullptr) return endShared(channel, reason, now);
  const bool together = channel.group != 0 && channel.follows() && reason != EndReason::kDone;
  endOne(channel, reason, now);
  if (!together) return;
  for (Channel& other : channels_) {
    if (other.follows() && other.group == channel.group) {
      end(other, EndReason::kCompanion, now);
    }
  }
}

// Whatever ends one of them early ends all of them, and each one's companions.
void PulseEngine::endShared(Channel& channel, EndReason reason, Nanoseconds now) {
  SharedMotors& shared = *channel.shared;
  if (reason == EndReason::kDone) {
    shared.finish(channel);
    return endOne(channel, reason, now);
  }
  if (shared.ends) return;
  shared.ends = true;
  shared.ends_fast = shared.isFast(now - state_.slipped);
  for (Channel* axis : shared.axes()) {
    if (channel.drives) axis->state.end_lateness = channel.state.end_lateness;
    const bool moved = axis->follows();
    if (!moved && axis != &channel) {
      changed(*axis);
      continue;
    }
    endOne(*axis, axis == &channel || isOfAllAxes(reason) ? reason : EndReason::kCompanion, now);
    if (!moved || axis->group == 0) continue;
    for (Channel& other : channels_) {
      if (other.follows() && other.group == axis->group && other.shared != &shared) {
        end(other, EndReason::kCompanion, now);
      }
    }
  }
  shared.halt();
  shared.ends = shared.ends_fast = false;
  news_ = true;
}

void PulseEngine::endOne(Channel& channel, EndReason reason, Nanoseconds now) {
  channel.endMotion(reason, now - state_.slipped);
  news_ = true;
  changed(channel);
}

// ---- times ----

// A step of one motor may be what another axis waits for.
void PulseEngine::changedTogether(const Channel& channel) {
  for (const auto* all : {&channel.shared->axes(), &channel.shared->motors()}) {
    for (Channel* other : *all) changed(*other);
  }
}

void PulseEngine::scheduleChanged() {
  bool slid = std::exchange(slid_in_write_, false);
  for (Channel* channel : changed_) {
    channel->changed = false;
    slid = schedule(*channel) || slid;
  }
  changed_.clear();
  if (slid) scheduleAll();
}

void PulseEngine::scheduleAll() {
  // A slide moves everything scheduled before it; no second slide follows for the same reason.
  bool slid = true;
  while (slid) {
    slid = false;
    for (Channel& channel : channels_) slid = schedule(channel) || slid;
  }
}

// An axis that shares motors makes no step of its own.
void PulseEngine::scheduleShared(const Channel& axis) {
  const auto at = axis.shared->dueOf(axis);
  dues_.set(axis.index, at ? std::max(*at + state_.slipped, axis.look_at) : kNever);
}

bool PulseEngine::schedule(Channel& channel) {
  if (channel.shared != nullptr) {
    if (!channel.drives) {
      scheduleShared(channel);
      return false;
    }
    if (!channel.high && channel.shared->isObsolete(channel)) {
      dues_.set(channel.index, kNever);
      return false;
    }
  }
  while (!channel.high && channel.isSucceeded()) {
    channel.adopt(channel.successors.takeFirst());
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
      // The time that a slow write takes from the next interval belongs to the same slip as its
      // lateness.
      slid = channel.next && !channel.isSucceeded() &&
             !(channel.shared != nullptr && channel.shared->isObsolete(channel)) &&
             slideFor(channel, closestRise(channel));
      break;
    case Action::kTurn:
      due = channel.state.pulses != 0 ? channel.rose + channel.config.dir_hold : 0;
      break;
    case Action::kFinish:
      due = std::max(channel.profile.endNs() + state_.slipped, channel.look_at);
      break;
  }
  dues_.set(channel.index, due);
  return slid;
}

// How late the next step may be without a slide.
Nanoseconds PulseEngine::absorbed(const Channel& channel, Nanoseconds motion_now) {
  const auto part =
      static_cast<Nanoseconds>((1.0 - kClosest) * static_cast<double>(channel.interval()));
  return channel.catchesUp() ? std::max(part, channel.angleAsTime(motion_now)) : part;
}

// The earliest time at which the next step may follow the last one.
Nanoseconds PulseEngine::closestRise(const Channel& channel) {
  const ChannelConfig& config = channel.config;
  if (!channel.catchesUp()) {
    return channel.rose +
           static_cast<Nanoseconds>(kClosest * static_cast<double>(channel.interval()));
  }
  return config.both_edges ? channel.rose : channel.rose + config.step_high + config.step_low;
}

bool PulseEngine::scheduleRise(Channel& channel) {
  const ChannelConfig& config = channel.config;
  Nanoseconds earliest = std::max(channel.state.ready, channel.turned + config.dir_setup);
  if (channel.state.pulses != 0) {
    // Both edges being steps, the last one was the beginning of the active time, or its end.
    Nanoseconds gap = channel.toggled != 0 ? config.step_high : config.step_low;
    if (!channel.isAlone() && channel.toggled != 0) gap = std::max(gap, config.step_low);
    earliest = std::max({earliest, channel.fell + gap, closestRise(channel)});
  }
  dues_.set(channel.index, std::max(channel.next->time_ns + state_.slipped, earliest));
  return slideFor(channel, earliest);
}

// The next step can't go out before `earliest`.
bool PulseEngine::slideFor(const Channel& channel, Nanoseconds earliest) {
  const Nanoseconds motion_then = earliest - state_.slipped;
  Nanoseconds lag = motion_then - channel.next->time_ns;
  if (lag <= 0) return false;
  if (channel.catchesUp()) lag -= channel.angleAsTime(motion_then);
  if (lag <= 0) return false;
  slide(lag);
  return true;
}

void PulseEngine::slide(Nanoseconds by) {
  state_.slipped += by;
  if (!slid_) ++state_.slips;
  slid_ = true;
  figures_.store(state_);
}

}  // namespace stepdriver::pulse
