#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "stepdriver_core/motion/profile.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Writes to pins other than STEP and DIR, one after the other, each with the time that must pass
/// before what comes next: the next write, or the first step.
struct PinSequence {
  /// One write of a pin, and how long nothing else of the channel goes out after it.
  struct Write {
    int line;
    bool level;
    Nanoseconds then_wait;
  };

  static constexpr std::size_t kCapacity = 8;
  std::array<Write, kCapacity> writes{};
  std::size_t size = 0;

  /// @throw std::out_of_range beyond kCapacity.
  void add(int line, bool level, Nanoseconds then_wait) {
    writes.at(size++) = {line, level, then_wait};
  }
};

/// A profile that a channel is to follow from its start time on, instead of the one before it.
struct Follow {
  int channel = 0;
  std::uint64_t serial = 0;
  const motion::Profile* profile = nullptr;  ///< lives until the channel follows another or none
  /// Serial of the profile that this one was planned to go on from, the last one that was ordered;
  /// 0: from rest. Where the channel has ended that, it can't be taken.
  std::uint64_t continues = 0;
  /// Steps planned closer than this are at a speed that the motor can't start from or stop at
  /// without a ramp.
  Nanoseconds restart_interval = 0;
  /// Channels of one group that isn't 0 end together: what ends one of them before its time ends
  /// all others at once.
  std::uint64_t group = 0;
};

/// An order to the pulse thread. Serials rise by one on each channel.
struct Command {
  /// What it orders.
  enum class Kind {
    kFollow,  ///< follow the profiles, all of them, or where one can't be taken none
    kPins,    ///< write the pins, at rest; then, where a scale is given, take that
  };

  Kind kind = Kind::kFollow;
  const Follow* follows = nullptr;  ///< of kFollow; live until the channels have taken the order
  std::size_t follow_count = 0;
  int channel = 0;  ///< of kPins, as all below
  std::uint64_t serial = 0;
  PinSequence pins;
  /// Where the motor stands then, in the microsteps of a new mode.
  struct Scale {
    std::int64_t count = 0;
    std::int64_t slack = 0;
    std::int64_t backlash = 0;
  };
  std::optional<Scale> scale;
};

}  // namespace stepdriver::pulse
