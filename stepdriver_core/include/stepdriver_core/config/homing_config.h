#pragma once

namespace stepdriver::config {

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

}  // namespace stepdriver::config
