#pragma once

#include <string>

namespace stepdriver::axis {

/// How an axis finds its zero: by the place where one of its endstop switches closes. A unit is m
/// on a linear axis, rad on a rotary one.
struct HomingConfig {
  bool at_max = false;       ///< the switch is the max endstop; else the min endstop
  double seek_speed = 0.0;   ///< [unit/s] towards the switch at first
  double latch_speed = 0.0;  ///< [unit/s] off the switch, and back to the place that counts
  double pull_off = 0.0;     ///< [unit] from the trigger point to where it stands at the end
  double offset = 0.0;       ///< [unit] position of the trigger point
  double max_travel = 0.0;   ///< [unit] that each stroke takes at most to reach or leave the switch
  double timeout = 60.0;     ///< [s] for all of it
  double debounce = 0.005;   ///< [s] that a level of the switch must last to count
  int order = 0;             ///< of several axes the lowest is first, the same are at once
};

/// What a homing does at one time.
enum class HomingPhase {
  kNone,
  kLeaving,     ///< off the switch that it stood on at the beginning
  kSeeking,     ///< towards the switch
  kBackingOff,  ///< off the switch, until it is open
  kLatching,    ///< slowly towards the switch: where it closes now is the trigger point
  kPullingOff,  ///< to where the axis stands at the end
  kStopping,    ///< it has failed, and comes to rest
};

/// In words, as in messages: `seeking`.
const char* nameOf(HomingPhase phase);

/// How a homing ended.
enum class HomingEnd { kHomed, kCancelled, kFailed };

/// How and where the homing of an axis ended.
struct HomingResult {
  std::string axis;
  HomingEnd end = HomingEnd::kFailed;
  std::string message;    ///< a sentence that says how it ended and where
  double position = 0.0;  ///< [unit] where the axis stands
};

}  // namespace stepdriver::axis
