#include "engine_channel.h"
#include "pulse/pulse_engine.h"

namespace stepdriver::pulse {

std::uint64_t PulseEngine::emergencyStop() {
  const std::uint64_t asked = asked_.fetch_add(1, std::memory_order_acq_rel) + 1;
  clock_.wake();
  return asked;
}

void PulseEngine::clearEmergencyStop(std::uint64_t served) {
  cleared_.store(served, std::memory_order_release);
}

// Every motion of a stop that was asked for before this pass has ended by now; the pulses that were
// out then may still be high.
void PulseEngine::serveStops() {
  const std::uint64_t asked = stopsAsked();
  if (asked == served_.load(std::memory_order_relaxed)) return;
  for (const Channel& channel : channels_) {
    if (channel.high || channel.profile != nullptr) return;
  }
  served_.store(asked, std::memory_order_release);
  news_ = true;
}

void PulseEngine::inputsChanged() {
  inputs_changed_.store(true, std::memory_order_release);
  clock_.wake();
}

void PulseEngine::readEmergencyStop() {
  if (!emergency_input_) return;
  const int level = lines_.read(emergency_input_->line);
  const bool active = level < 0 || (level != 0) == emergency_input_->active;
  // Active still after a clear: that is a stop of its own.
  if (active && !(emergency_input_active_ && emergencyStopped())) {
    input_stops_.fetch_add(1, std::memory_order_release);
    asked_.fetch_add(1, std::memory_order_acq_rel);
  }
  emergency_input_active_ = active;
}

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
  if (channel.reserved || now < channel.state.ready) return;
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

bool PulseEngine::mayStep(Channel& channel, Nanoseconds now) {
  // A chip may wake with a fault that it had before: its line doesn't change then.
  if (channel.unchecked && now >= channel.state.ready) {
    channel.unchecked = false;
    readFault(channel, now);
    if (!channel.next) return false;
  }
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

}  // namespace stepdriver::pulse
