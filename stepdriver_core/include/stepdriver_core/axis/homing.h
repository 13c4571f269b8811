#pragma once

#include <string>

namespace stepdriver::axis {

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
