#include "port/pulse_train.h"

namespace stepdriver::pulse {

PulseTrain::PulseTrain(const ChannelConfig& config, StepPort::Lane& lane)
    : config_(config),
      lane_(lane),
      motors_(1 + config.twins.size()),
      all_motors_(static_cast<MotorSet>(motorBit(motors_) - 1)),
      pulsed_(all_motors_) {
  for (std::size_t i = 0; i < motors_; ++i) {
    forward_.at(i) = signalsOf(i).step;
    backward_.at(i) = config.dir_steps ? signalsOf(i).dir : signalsOf(i).step;
  }
  lane_.direction = -1;
  lane_.takes = takes();
}

void PulseTrain::failed(Nanoseconds now) {
  if (lane_.busy || config_.both_edges) fell_ = now;
  if (!lane_.busy) stepAt(now);
  lane_.busy = false;
  lane_.takes = takes();
}

}  // namespace stepdriver::pulse
