#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stepdriver::machine {

/// What the numbers of a stream of setpoints are.
enum class SetpointMode { kPosition, kVelocity };

/// A message of a stream for one axis, see Machine::jog() and Machine::followSetpoints().
struct StreamMessage {
  std::string name;    ///< the axis's name
  double value = 0.0;  ///< [unit] a position, or [unit/s] a velocity: m or rad
  /// AxisState::stops as it was when the stream began: a stream does not continue after a stop, a
  /// hold, a disable or a recover. Empty: it is not checked.
  std::optional<std::uint64_t> unless_stopped_since;
};

}  // namespace stepdriver::machine
