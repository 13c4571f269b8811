#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "channel/channel_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The pulses of one channel: the levels of its lines of STEP and DIR, when their last edges
/// happened, and when the next ones may. All times are clock times at the ends of writes. For the
/// pulse thread.
class PulseTrain {
 public:
  /// @param config outlives this.
  explicit PulseTrain(const ChannelConfig& config);

  std::size_t motors() const { return motors_; }
  /// The pulse is out; never so if both edges are steps.
  bool high() const { return high_; }
  /// The steps backward have lines of their own.
  bool stepsOnDir() const { return config_.dir_steps; }
  /// Of the last DIR edge, or of the lines that make the steps: +1 or -1.
  int direction() const { return direction_; }
  Nanoseconds rose() const { return rose_; }
  /// Active edges.
  std::uint64_t pulses() const { return pulses_; }
  /// A motor takes part in the last edge.
  bool hasPulsed(std::size_t motor) const { return (pulsed_ & motorBit(motor)) != 0; }
  bool allPulsed() const { return pulsed_ == all_motors_; }

  /// @name When the chip allows the next edge
  /// @{
  Nanoseconds fallDue() const { return rose_ + config_.step_high; }
  Nanoseconds turnDue() const { return pulses_ != 0 ? rose_ + config_.dir_hold : 0; }
  Nanoseconds riseDue() const;
  /// The earliest time of the next rise after one that just happened.
  Nanoseconds closestRise() const {
    return config_.both_edges ? rose_ : rose_ + config_.step_high + config_.step_low;
  }
  /// @}

  /// @name Edges
  /// @{
  /// A pulse begins on all motors but those.
  void beginPulse(MotorSet still) { pulsed_ = all_motors_ & static_cast<MotorSet>(~still); }
  /// The line of a motor and its level after the next edge. It is put there member by member: the
  /// processor would wait for a copy of a complete pair.
  void putEdge(std::size_t motor, gpio::LineWrite& write) const {
    const Signal& step = stepOf(motor, direction_);
    write.output = step.line;
    write.level = step.active != (high_ || (toggled_ & motorBit(motor)) != 0);
  }
  /// Of a motor's DIR line.
  gpio::LineWrite turnOf(std::size_t motor, bool forward) const {
    const Signal& dir = signalsOf(motor).dir;
    return {dir.line, forward ? dir.active : !dir.active};
  }
  /// The pulse has ended.
  void fall(Nanoseconds now) {
    high_ = false;
    fell_ = now;
  }
  /// A step has gone out.
  void rise(Nanoseconds now);
  /// An edge could not be written, and may have happened.
  void failed(Nanoseconds now);
  void turned(int direction, Nanoseconds now) {
    direction_ = direction;
    turned_ = now;
  }
  /// @}

 private:
  const MotorSignals& signalsOf(std::size_t motor) const {
    return motor == 0 ? config_ : config_.twins[motor - 1];
  }
  // A motor's line of pulses in a direction.
  const Signal& stepOf(std::size_t motor, int forward) const {
    const MotorSignals& signals = signalsOf(motor);
    return config_.dir_steps && forward < 0 ? signals.dir : signals.step;
  }

  const ChannelConfig& config_;
  const std::size_t motors_;
  const MotorSet all_motors_;
  MotorSet pulsed_;
  MotorSet toggled_ = 0;  // both edges are steps, and these motors' lines are at their active level
  bool high_ = false;
  int direction_ = -1;
  std::uint64_t pulses_ = 0;
  Nanoseconds rose_ = 0;
  Nanoseconds fell_ = 0;
  Nanoseconds turned_ = 0;
};

inline Nanoseconds PulseTrain::riseDue() const {
  const Nanoseconds turned = turned_ + config_.dir_setup;
  if (pulses_ == 0) return turned;
  // Both edges being steps, the last one was the beginning of the active time, or its end.
  Nanoseconds gap = toggled_ != 0 ? config_.step_high : config_.step_low;
  if (motors_ > 1 && toggled_ != 0) gap = std::max(gap, config_.step_low);
  return std::max(turned, fell_ + gap);
}

inline void PulseTrain::rise(Nanoseconds now) {
  if (config_.both_edges) {
    toggled_ ^= pulsed_;
    fell_ = now;
  } else {
    high_ = true;
  }
  rose_ = now;
  ++pulses_;
}

}  // namespace stepdriver::pulse
