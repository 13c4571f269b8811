#include "port/pulse_train.h"

namespace stepdriver::pulse {

PulseTrain::PulseTrain(const ChannelConfig& config)
    : config_(config),
      motors_(1 + config.twins.size()),
      all_motors_(static_cast<MotorSet>(motorBit(motors_) - 1)),
      pulsed_(all_motors_) {}

void PulseTrain::failed(Nanoseconds now) {
  if (high_ || config_.both_edges) fell_ = now;
  if (!high_) rose_ = now;
  high_ = false;
}

}  // namespace stepdriver::pulse
