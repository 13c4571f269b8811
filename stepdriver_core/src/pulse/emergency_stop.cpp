#include "stepdriver_core/pulse/pulse_engine.h"

namespace stepdriver::pulse {

void PulseEngine::emergencyStop() {
  emergency_.store(true, std::memory_order_release);
  clock_.wake();
}

void PulseEngine::clearEmergencyStop() { emergency_.store(false, std::memory_order_release); }

void PulseEngine::readEmergencyStop() {
  if (!emergency_input_) return;
  const int level = lines_.read(emergency_input_->line);
  const bool active = level < 0 || (level != 0) == emergency_input_->active;
  // Active still after a clear: that is a stop of its own.
  if (active && !(emergency_input_active_ && emergencyStopped())) {
    emergency_.store(true, std::memory_order_release);
    input_stops_.fetch_add(1, std::memory_order_release);
  }
  emergency_input_active_ = active;
}

}  // namespace stepdriver::pulse
