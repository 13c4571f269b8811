#include "guard/emergency_stops.h"

namespace stepdriver::pulse {

std::uint64_t EmergencyStops::askAtOnce() {
  const std::uint64_t asked = counts_.ask();
  at_once_.store(asked, std::memory_order_release);
  return asked;
}

void EmergencyStops::readInput(bool active) {
  if (active && !(input_active_ && stopped())) {
    const bool ramps = isRamping();
    input_stops_.fetch_add(1, std::memory_order_release);
    counts_.ask();
    if (ramps) ++until_;
  }
  input_active_ = active;
}

bool EmergencyStops::isRamping() const {
  return ramping() > served() && until_ == asked() &&
         at_once_.load(std::memory_order_acquire) <= served();
}

bool EmergencyStops::beginRamp(Nanoseconds now) {
  if (longest_ == 0 || !unserved() || ramping() > served()) return false;
  until_ = asked();
  began_ = now;
  ramping_.store(until_, std::memory_order_release);
  return true;
}

}  // namespace stepdriver::pulse
