#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "channel/channel_config.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::motor {

/// Writes to pins other than STEP and DIR, one after the other, each with the time that must pass
/// before the next write or the first step. There is room for all motors of an axis.
struct PinSequence {
  /// One write of a pin, and how long nothing else may be written to the chip after it.
  struct Write {
    int line;
    bool level;
    pulse::Nanoseconds then_wait;
  };

  static constexpr std::size_t kCapacity = 8 * pulse::kMostMotors;
  std::array<Write, kCapacity> writes{};
  std::size_t size = 0;
  /// Afterwards, if lines switch the coils of the motors, whether these have current. The pulse
  /// thread writes them, because the steps are writes of them too.
  std::optional<bool> coils;

  /// @throw std::out_of_range beyond kCapacity.
  void add(int line, bool level, pulse::Nanoseconds then_wait) {
    writes.at(size++) = {line, level, then_wait};
  }

  /// @throw std::out_of_range beyond kCapacity.
  void append(const PinSequence& other) {
    for (std::size_t i = 0; i < other.size; ++i) writes.at(size++) = other.writes[i];
    if (other.coils) coils = other.coils;
  }
};

}  // namespace stepdriver::motor
