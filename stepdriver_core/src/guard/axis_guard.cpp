#include "guard/axis_guard.h"

#include <algorithm>

namespace stepdriver::pulse {
namespace {

// How often the in-position output is read at the end of a motion, if no edge is reported.
constexpr Nanoseconds kLookPeriod = 1'000'000;

}  // namespace

AxisGuard::AxisGuard(const ChannelConfig& config, ChannelState& state, WatchedLines& lines)
    : config_(config),
      state_(state),
      lines_(lines),
      all_motors_(static_cast<MotorSet>(motorBit(motors()) - 1)),
      has_switch_(has(&MotorSignals::endstop_min) || has(&MotorSignals::endstop_max)),
      idle_(!has_switch_ && !has(&MotorSignals::fault) && !config.block && config.twins.empty()),
      shared_(config.assumed_end) {
  state_.pressed = shared_.pressed();
}

bool AxisGuard::has(std::optional<Signal> MotorSignals::*signal) const {
  for (std::size_t i = 0; i < motors(); ++i) {
    if (motor(i).*signal) return true;
  }
  return false;
}

void AxisGuard::begin(const Manner& manner, Nanoseconds now) {
  squares_ = manner.squares;
  until_block_ = manner.until_block;
  began_ = now;
  if (manner.is_square) square_lags_ = state_.lags;
  shared_.begin(state_.count);
}

void AxisGuard::end() {
  squares_ = until_block_ = settling_ = false;
  shared_.follow(state_.count, config_.switch_release);
  state_.pressed = shared_.pressed();
}

void AxisGuard::reserve() {
  reserved_ = true;
  faulty_ = 0;  // it must be read again when the pins have been written
  shared_.forget();
  state_.pressed = shared_.pressed();
}

void AxisGuard::release() {
  reserved_ = false;
  unchecked_ = has(&MotorSignals::fault);
}

std::optional<Objection> AxisGuard::readFault(std::size_t number) {
  const auto& fault = motor(number).fault;
  if (!fault) return std::nullopt;
  const int level = lines_.read(fault->line);
  const bool faulty = level < 0 || (level != 0) == fault->active;
  const bool was_faulty = (faulty_ & motorBit(number)) != 0;
  if (faulty == was_faulty) return std::nullopt;
  faulty_ ^= motorBit(number);
  if (!faulty) return std::nullopt;
  if (level < 0) return Objection{EndReason::kLineError, {-level, fault->line, true}};
  if (until_block_ && config_.block_is_fault) return Objection{EndReason::kBlocked, {}};
  countFault(number);
  return Objection{EndReason::kChipFault, {}};
}

void AxisGuard::noteFault(std::size_t number) {
  if ((faulty_ & motorBit(number)) != 0) return;
  faulty_ |= motorBit(number);
  countFault(number);
}

void AxisGuard::countFault(std::size_t number) {
  ++state_.chip_faults;
  state_.chip_at_fault = static_cast<std::uint8_t>(number);
}

std::optional<Objection> AxisGuard::mayStep(int direction) {
  // What has reported a block ends its report in the motion off it.
  for (std::size_t i = 0; config_.block_is_fault && faulty_ != 0 && i < motors(); ++i) {
    if ((faulty_ & motorBit(i)) != 0) readFault(i);
  }
  if (config_.switch_release > 0.0 && direction != 0) {
    if (auto objection = readSharedSwitch(direction)) return objection;
  } else if (has_switch_ && direction != 0) {
    for (std::size_t i = 0; i < motors(); ++i) {
      if ((state_.still & motorBit(i)) != 0) continue;
      if (auto objection = readSwitch(i, direction > 0)) return objection;
    }
  }
  if (squares_ && state_.still != 0 && wouldSkew(direction)) {
    return Objection{EndReason::kSkewed, {}};
  }
  return until_block_ ? readBlock() : std::nullopt;
}

// The report of a block may be shorter than the time between two steps: then only its edge tells.
std::optional<Objection> AxisGuard::readBlock() {
  for (std::size_t i = 0; config_.block_is_fault && i < motors(); ++i) {
    if (auto objection = readFault(i)) return objection;
  }
  if (!config_.block) return std::nullopt;
  const int level = lines_.read(config_.block->line);
  if (level < 0) return Objection{EndReason::kLineError, {-level, config_.block->line, true}};
  const bool is_blocked = (level != 0) == config_.block->active ||
                          block_edge_.load(std::memory_order_acquire) >= began_;
  if (!is_blocked) return std::nullopt;
  return Objection{EndReason::kBlocked, {}};
}

std::optional<Objection> AxisGuard::readSharedSwitch(int direction) {
  const Signal& endstop = *config_.endstop_min;
  const int level = lines_.read(endstop.line);
  if (level < 0) return Objection{EndReason::kLineError, {-level, endstop.line, true}};
  const bool is_active = (level != 0) == endstop.active;
  if (shared_.mayStep(state_.count, direction, is_active, config_.switch_release)) {
    return std::nullopt;
  }
  return Objection{direction > 0 ? EndReason::kEndstopMax : EndReason::kEndstopMin, {}};
}

// A motor that squares stops at its own switch, and the others continue.
std::optional<Objection> AxisGuard::readSwitch(std::size_t number, bool forward) {
  const MotorSignals& signals = motor(number);
  const auto& endstop = forward ? signals.endstop_max : signals.endstop_min;
  if (!endstop) return std::nullopt;
  const int level = lines_.read(endstop->line);
  if (level < 0) return Objection{EndReason::kLineError, {-level, endstop->line, true}};
  if ((level != 0) != endstop->active) return std::nullopt;
  if (squares_) state_.still |= motorBit(number);
  if (squares_ && state_.still != all_motors_) return std::nullopt;
  return Objection{forward ? EndReason::kEndstopMax : EndReason::kEndstopMin, {}};
}

std::int64_t AxisGuard::skewAfter(int direction) const {
  MotorCounts lags = state_.lags;
  for (std::size_t i = 0; i < motors(); ++i) {
    if ((state_.still & motorBit(i)) != 0) lags[i] -= direction;
  }
  return skewOf(lags, square_lags_, motors());
}

bool AxisGuard::wouldSkew(int direction) const {
  const std::int64_t after = skewAfter(direction);
  return after > config_.max_skew && after > skewAfter(0);
}

AxisGuard::Settling AxisGuard::settle(Nanoseconds now) {
  std::size_t unsettled = motors();
  for (std::size_t i = motors(); i-- > 0;) {
    const auto& in_position = motor(i).in_position;
    if (!in_position) continue;
    const int level = lines_.read(in_position->line);
    if (level < 0) {
      failure_ = {-level, in_position->line, true};
      return Settling::kFailed;
    }
    if ((level != 0) != in_position->active) unsettled = i;
  }
  if (unsettled == motors()) return Settling::kDone;
  state_.unsettled = static_cast<std::uint8_t>(unsettled);
  if (!settling_) settling_since_ = now;
  settling_ = true;
  const Nanoseconds latest = settling_since_ + config_.in_position_timeout;
  if (now >= latest) {
    state_.waited = now - settling_since_;
    return Settling::kTooLong;
  }
  look_at_ = std::min(now + kLookPeriod, latest);
  return Settling::kWaits;
}

// A plan without a step, as for another speed, doesn't begin the wait again.
void AxisGuard::adopted(bool steps) {
  if (steps) settling_ = false;
  look_at_ = 0;
}

}  // namespace stepdriver::pulse
