#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "channel/channel_config.h"
#include "port/step_port.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The pulses of one channel: the levels of its lines of STEP and DIR, when their last edges
/// happened, and when the next ones may; its lane tells the engine of them. All times are clock
/// times at the ends of writes. For the pulse thread.
class PulseTrain {
 public:
  /// @param config, lane outlive this.
  PulseTrain(const ChannelConfig& config, StepPort::Lane& lane);

  std::size_t motors() const { return motors_; }
  const StepPort::Lane& lane() const { return lane_; }
  /// The steps backward have lines of their own.
  bool stepsOnDir() const { return config_.dir_steps; }
  /// A motor takes part in the last edge.
  bool hasPulsed(std::size_t motor) const { return (pulsed_ & motorBit(motor)) != 0; }
  /// Those that don't.
  MotorSet still() const { return all_motors_ & static_cast<MotorSet>(~pulsed_); }

  /// @name When the chip allows the next edge
  /// @{
  Nanoseconds fallDue() const { return lane_.last + config_.step_high; }
  Nanoseconds turnDue() const { return lane_.stepped ? lane_.last + config_.dir_hold : 0; }
  /// @}

  /// @name Edges
  /// @{
  /// A pulse begins on all motors but those.
  void beginPulse(MotorSet still) { pulsed_ = all_motors_ & static_cast<MotorSet>(~still); }
  /// The lines of the motors that take part, and their levels after the next edge. They are put
  /// there member by member: the processor would wait for a copy of a complete pair.
  /// @return the end of them.
  gpio::LineWrite* putEdges(gpio::LineWrite* write) const {
    const Signal* step = lane_.direction > 0 ? forward_.data() : backward_.data();
    const MotorSet ends = lane_.busy ? all_motors_ : toggled_;
    for (MotorSet motor = 1; motor <= pulsed_; motor = static_cast<MotorSet>(motor << 1U), ++step) {
      if ((pulsed_ & motor) == 0) continue;
      write->output = step->line;
      write->level = step->active != ((ends & motor) != 0);
      ++write;
    }
    return write;
  }
  /// The write that turns a motor's DIR line.
  gpio::LineWrite turnOf(std::size_t motor, bool forward) const {
    const Signal& dir = signalsOf(motor).dir;
    return {dir.line, forward ? dir.active : !dir.active};
  }
  /// The pulse has ended.
  void fall(Nanoseconds now) {
    lane_.busy = false;
    fell_ = now;
    lane_.takes = takes();
  }
  /// A step has gone out.
  void rise(Nanoseconds now);
  /// An edge could not be written, and may have happened.
  void failed(Nanoseconds now);
  void turned(int direction, Nanoseconds now) {
    lane_.direction = direction;
    turned_ = now;
    lane_.takes = takes();
  }
  /// @}

 private:
  const MotorSignals& signalsOf(std::size_t motor) const {
    return motor == 0 ? config_ : config_.twins[motor - 1];
  }
  Nanoseconds takes() const;
  void stepAt(Nanoseconds now) {
    lane_.last = now;
    lane_.closest = config_.both_edges ? now : now + config_.step_high + config_.step_low;
  }

  const ChannelConfig& config_;
  StepPort::Lane& lane_;
  const std::size_t motors_;
  const MotorSet all_motors_;
  // Each motor's lines of pulses in the two directions.
  std::array<Signal, kMostMotors> forward_;
  std::array<Signal, kMostMotors> backward_;
  MotorSet pulsed_;
  MotorSet toggled_ = 0;  // both edges are steps, and these motors' lines are at their active level
  Nanoseconds fell_ = 0;
  Nanoseconds turned_ = 0;
};

inline Nanoseconds PulseTrain::takes() const {
  const Nanoseconds turned = turned_ + config_.dir_setup;
  if (!lane_.stepped) return turned;
  // Both edges being steps, the last one was the beginning of the active time, or its end.
  Nanoseconds gap = toggled_ != 0 ? config_.step_high : config_.step_low;
  if (motors_ > 1 && toggled_ != 0) gap = std::max(gap, config_.step_low);
  return std::max(turned, fell_ + gap);
}

inline void PulseTrain::rise(Nanoseconds now) {
  lane_.stepped = true;
  stepAt(now);
  if (config_.both_edges) {
    toggled_ ^= pulsed_;
    fell_ = now;
    lane_.takes = takes();
  } else {
    lane_.busy = true;
  }
}

}  // namespace stepdriver::pulse
