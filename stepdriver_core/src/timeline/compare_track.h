#pragma once

#include <cstdint>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// What an output does when the joint of an axis passes an edge of its track.
enum class CompareAction : std::uint8_t {
  kNothing,
  kOn,
  kOff,
  kPulse,  ///< on, and off again after CompareTrack::pulse
};

/// An edge between two counts of the joint: `at` - 1 below it, and `at` above.
struct CompareEdge {
  std::int64_t at = 0;
  CompareAction up = CompareAction::kNothing;    ///< when the count becomes `at`
  CompareAction down = CompareAction::kNothing;  ///< when it becomes `at` - 1
};

/// What the position of an axis makes an output do (position compare, cam switches).
struct CompareTrack {
  std::vector<CompareEdge> edges;  ///< each above the one before it
  bool by_place = false;           ///< whether it is on says the place, and not how it was reached
  Nanoseconds pulse = 0;           ///< how long a pulse is on
  bool pulse_at_end = false;       ///< a motion that comes to its end makes one too
  /// How much earlier than at its place an action comes: kOn and kPulse, and kOff.
  Nanoseconds lead_on = 0;
  Nanoseconds lead_off = 0;
  /// [microsteps] All of the backlash: when the joint moves up, the count of the motor is above
  /// that of the joint by this.
  std::int64_t backlash = 0;
};

}  // namespace stepdriver::pulse
